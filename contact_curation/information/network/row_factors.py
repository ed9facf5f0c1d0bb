"""The smallest factor of F = G^T G from the rows of G, scores in many columns, without forming F.

G G^T and F have the same non-zero eigenvalues, and with G G^T = U diag(lambda) U^T the rows U^T G are those of `factors`:
orthogonal, strongest first, of length sqrt(lambda).
"""

import numpy as np
import scipy.linalg

from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression, Factor, factor_of_fisher


def factor_of_rows(rows: Array, compression: Compression) -> Factor:
    """The factor of G^T G for rows G (N, P); see `factors.Factor`."""
    count, columns = rows.shape
    if count >= columns:
        return factor_of_fisher(rows.T @ rows, compression)
    gram = rows @ rows.T
    first = max(count - compression.max_rows, 0)
    values, vectors = scipy.linalg.eigh(gram, subset_by_index=(first, count - 1)) if count else (np.zeros(0), gram)
    kept = values > compression.cut * max(float(values.max(initial=0.0)), 0.0)
    found = (vectors[:, kept].T @ rows)[::-1]
    strongest = found[np.arange(len(found)), np.abs(found).argmax(axis=1)] if len(found) else np.zeros(0)
    found = found * np.where(strongest < 0.0, -1.0, 1.0)[:, None]
    total = float(np.trace(gram))
    return Factor(np.ascontiguousarray(found), float(values[kept].sum()) / total if total > 0.0 else 1.0)

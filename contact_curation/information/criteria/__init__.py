"""The criteria by which tosses are selected: a file each, and a line each here, in the order of `--help`."""
# ruff: noqa: I001

from contact_curation.information.criteria.trace import TRACE as TRACE
from contact_curation.information.criteria.log_det import LOG_DET as LOG_DET
from contact_curation.information.criteria.representative import REPRESENTATIVE as REPRESENTATIVE
from contact_curation.information.criteria.herding import HERDING as HERDING
from contact_curation.information.criteria.facility_location import FACILITY_LOCATION as FACILITY_LOCATION
from contact_curation.information.criteria.v_optimal import V_OPTIMAL as V_OPTIMAL
from contact_curation.information.criteria.min_eig import MIN_EIG as MIN_EIG
from contact_curation.information.criteria.orthogonal import ORTHOGONAL as ORTHOGONAL
from contact_curation.information.criteria.leverage import LEVERAGE as LEVERAGE
from contact_curation.information.criteria.longest import LONGEST as LONGEST
from contact_curation.information.criteria.random import RANDOM as RANDOM

"""Translates the information of tosses."""

from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from contact_curation_msgs.msg import TossInformation as TossInformationMessage
from contact_curation_msgs.srv import GetInformation
from geometry_msgs.msg import Point

from contact_curation.errors import InvalidValueError
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.nodes.messages.bounds import LARGEST_INFORMATION, MOST_NUMBERS, check_numbers, check_size
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message
from contact_curation.nodes.ros.catch_up import Source

INFORMATION = Source(TossInformationMessage, "toss_information", GetInformation, "get_information", "information", page=64)
"""What nodes that need the information of all tosses follow."""


def information_message(information: TossInformation, sequence: int, stamped: Stamped) -> TossInformationMessage:
    """Makes the message that announces the information of a toss.

    Args:
        information: the record.
        sequence: its number in the scorer's store, from 1.
        stamped: stamp of the toss's last frame, and frame of the board.
    """
    x, y, z = information.centroid.tolist()
    return TossInformationMessage(
        format_version=TossInformationMessage.FORMAT_VERSION,
        header=header_message(stamped),
        toss_id=information.toss_id,
        body=information.body,
        sequence=sequence,
        model=information.model,
        parameters_version=information.parameters_version,
        estimator=information.estimator,
        influence_bound=float(information.influence_bound),
        block_names=[block.name for block in information.blocks],
        block_sizes=[block.stop - block.start for block in information.blocks],
        block_traces=information.block_traces.tolist(),
        transitions=information.transitions,
        not_scored=information.not_scored,
        duration=information.duration,
        mean_loss=information.mean_loss,
        centroid=Point(x=x, y=y, z=z),
        score_sum=information.score_sum.tolist(),
        factor_rows=information.factor.shape[0],
        factor=information.factor.ravel().tolist(),
        tilt_axes=information.tilt_axes.ravel().tolist(),
    )


def information_of(message: Any) -> TossInformation:
    """Reads the information of a message, with the same bits.

    Raises:
        InvalidValueError: the format is newer, the sizes of arrays are inconsistent or too large, or a number is out of bounds.
    """
    check_format(message)
    sizes, names, rows = list(message.block_sizes), list(message.block_names), int(message.factor_rows)
    parameters = sum(sizes)
    check_size(f"factor of toss {message.toss_id[:80]}", message.factor, MOST_NUMBERS)
    if parameters == 0:
        raise InvalidValueError(f"blocks of toss {message.toss_id}", "no parameter", "at least one")
    if len(sizes) != len(names) or len(message.factor) != rows * parameters:
        found = f"{len(names)} names, {len(sizes)} sizes and a factor of {len(message.factor)} numbers"
        raise InvalidValueError(f"blocks of toss {message.toss_id}", found, f"{rows} rows of the blocks' parameters")
    edges = pairwise(accumulate(sizes, initial=0))
    tilt = np.array(message.tilt_axes, dtype=float)
    information = TossInformation(
        toss_id=message.toss_id,
        body=message.body,
        model=message.model,
        parameters_version=message.parameters_version,
        estimator=message.estimator,
        influence_bound=message.influence_bound,
        blocks=tuple(ParameterBlock(name, *edge) for name, edge in zip(names, edges)),
        transitions=int(message.transitions),
        not_scored=int(message.not_scored),
        duration=message.duration,
        mean_loss=message.mean_loss,
        block_traces=np.array(message.block_traces, dtype=float),
        score_sum=np.array(message.score_sum, dtype=float),
        factor=np.array(message.factor, dtype=float).reshape(rows, parameters),
        centroid=np.array([message.centroid.x, message.centroid.y, message.centroid.z]),
        tilt_axes=tilt.reshape(-1, 3) if tilt.size % 3 == 0 else tilt,
    )
    toss_id = information.toss_id
    for name in ("mean_loss", "block_traces", "score_sum", "factor", "centroid", "tilt_axes"):
        check_numbers(f"{name} of toss {toss_id}", getattr(information, name), LARGEST_INFORMATION)
    if rows == 0 and information.trace != 0.0:
        raise InvalidValueError(f"factor of toss {toss_id}", "no row", f"rows of a trace of {information.trace:.3g}")
    if not information.influence_bound > 0.0:
        raise InvalidValueError(f"influence_bound of toss {toss_id}", information.influence_bound, "a positive number")
    return information

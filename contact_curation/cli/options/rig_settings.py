"""How tosses are put right of their rig, in the words of `--set`."""

from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration


def settings_of(rig: RigCalibration) -> str:
    """What puts tosses of this rig right, to 1e-5 and a tenth of a millimetre; nothing for a level one."""
    if rig == NO_CORRECTION:
        return ""
    normal = ",".join(f"{value:.5f}" for value in rig.normal)
    centre = ",".join(f"{value:.4f}" for value in rig.centre)
    return f"--set rig.normal={normal} --set rig.centre={centre} --set rig.scale={rig.scale:.5f}"

"""The benchmark of the residual model on a real machine's day."""

from benchmarks import residual
from tests.recordings import recording
from twin.residual.training import TrainingSettings


def test_of_the_real_mazak_no_model_is_made() -> None:
    """Its spindle temperature is not explained by speed and load: facts of the recording, not of the model."""
    found = residual.mazak(recording("nist/raw/Mazak01-20180718-20180719.txt"), TrainingSettings(trees=8, row_s=60.0))
    assert found["cutting_hours"] < 40.0  # so the command refuses it before it is judged
    assert found["refused"]

import pickle

import pytest

import kickdyn as kd


@pytest.mark.parametrize(
    ("kind", "parents"),
    [
        (kd.InvalidInput, (kd.KickdynError, ValueError)),
        (kd.UrdfError, (kd.InvalidInput, kd.KickdynError, ValueError)),
        (kd.NoImpact, (kd.KickdynError,)),
    ],
)
def test_every_error_can_be_caught_as_its_kin(kind, parents):
    assert all(issubclass(kind, parent) for parent in parents)
    assert not issubclass(kd.NoImpact, ValueError)  # an answer, not a bad value


def test_urdf_error_names_file_and_every_fault_on_one_line():
    error = kd.UrdfError("leg.urdf", ["has no link", "a joint has no name"])
    assert str(error) == "leg.urdf: has no link; a joint has no name"
    assert error.faults == ("has no link", "a joint has no name")


def test_urdf_error_survives_a_process_pool():
    error = kd.UrdfError("leg.urdf", ["one", "two"])
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy), copy.source, copy.faults) == (
        *(kd.UrdfError, str(error)),
        *("leg.urdf", ("one", "two")),
    )


LONG = "folder/" * 200 + "leg.urdf"


@pytest.mark.parametrize(
    "error",
    [
        kd.KickdynError(f"{LONG} is full"),
        kd.InvalidInput(f"{LONG} is full"),
        kd.UrdfError(LONG, ["has no link"]),
        kd.SceneError(LONG, ["has no leg"]),
        kd.SceneError(LONG.replace("/", " "), ["has no leg", "has no contact"]),
    ],
)
def test_a_long_name_of_a_file_loses_its_middle(error):
    assert "folder" in str(error)
    assert "leg.urdf" in str(error)
    assert len(str(error)) < 250
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_several_faults_are_one_message():
    error = kd.InvalidInput("a is 1:\n it must be 2", "b is 3")
    assert str(error) == "a is 1: it must be 2; b is 3"
    assert error.faults == ("a is 1: it must be 2", "b is 3")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)

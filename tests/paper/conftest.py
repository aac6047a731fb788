import pytest

from kickdyn.paper.reproduce import SECTIONS


@pytest.fixture(scope="session")
def compared():
    """Items of every section, and those with other coefficients."""
    return {section.name: section.compare() for section in SECTIONS}

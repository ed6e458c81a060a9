"""Copies of the project for the tests of the workflow."""

import pytest
from checkouts import copy_project


@pytest.fixture
def checkout(tmp_path):
    return copy_project(tmp_path / "project")


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A copy in which the tiny study has been run once."""
    checkout = copy_project(tmp_path_factory.mktemp("finished") / "project")
    done = checkout.run()
    assert done.returncode == 0, done.stderr + done.stdout
    checkout.output = done.stdout + done.stderr
    return checkout

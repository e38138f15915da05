"""The recipe for Ray in the docs: the same results on a cluster, a node of which is killed."""

import importlib
import os
import sys

import pytest
from tests.studies.scenes import base, digests, optional, run, small
from tests.test_docs import ROOT, blocks

from fleet2d.studies.driver import Observer
from fleet2d.studies.results import VariantResult

ray = optional("ray")
pytestmark = [
    pytest.mark.filterwarnings("ignore"),  # Ray's own
]


@pytest.fixture
def cluster():
    """A cluster of a head without cores and two nodes with one each."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    try:
        cluster.nodes_to_kill = [cluster.add_node(num_cpus=1) for _ in range(2)]
        cluster.wait_for_nodes()
        yield cluster
    finally:
        ray.shutdown()
        cluster.shutdown()


class KillsANode(Observer):
    """Kills a node of a cluster while workers on both nodes are at work."""

    def __init__(self, cluster):
        self.cluster, self.has_killed = cluster, False

    def on_result(self, result: VariantResult):
        if not self.has_killed:
            self.has_killed = True
            self.cluster.remove_node(self.cluster.nodes_to_kill[0], allow_graceful=False)


def test_a_node_that_dies_loses_only_what_it_ran(cluster, tmp_path, monkeypatch):
    # Runs take longer than a node takes to die: one that had just finished would lose nothing.
    study = small(base=base("4 days"), replicates=5)
    (recipe,) = [
        each for each in blocks(ROOT / "docs/how-to/studies.md") if each.title == "ray_study.py"
    ]
    (tmp_path / "ray_study.py").write_text(recipe.text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    executor = importlib.import_module("ray_study").RayExecutor()
    # Workers on this machine import the same modules as this process.
    paths = {"env_vars": {"PYTHONPATH": os.pathsep.join(sys.path)}}
    ray.init(cluster.address, runtime_env=paths, log_to_driver=False)
    observer = KillsANode(cluster)
    counts, killed = run(study, tmp_path / "killed", executor, 3, observer=observer)
    assert (10, 0) == (counts.complete, counts.failed)
    assert observer.has_killed
    _, undisturbed = run(study, tmp_path / "undisturbed")
    assert digests(undisturbed) == digests(killed)
    assert killed.variants["attempts"].max() >= 2  # what the node ran was run again

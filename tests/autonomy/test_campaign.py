"""Campaigns on threads, on a local cluster, and on a real cluster of Dask's own processes."""

import os

import numpy as np
import pytest

from autonomy import campaign
from autonomy.campaign import (
    ADDRESS_VARIABLE,
    CampaignCancelledError,
    Cluster,
    ClusterError,
    Threads,
    check_address,
    opened,
)
from autonomy.identification.problem import problem_from
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.comparison import compare
from autonomy.whatif.config import TABLE_3_1_LINEAR, DisturbanceConfig
from tests.autonomy.campaign_pieces import (
    counted_fault,
    faulty,
    met_process_of,
    norm,
    noted,
    process_of,
    slow,
)
from tests.autonomy.dask_cluster import WAIT_S, scheduler, wait_until, worker
from tests.autonomy.identification_flight import open_loop_recording
from tests.autonomy.test_identification_fit import SMALL, run, wrong_by
from tests.autonomy.test_whatif import changed, choice

pytestmark = pytest.mark.process


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A scheduler on a machine that is busy with other tests answers late."""
    monkeypatch.setattr(campaign, "_PATIENCE_S", WAIT_S)


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    """Two workers behind a scheduler, by its address."""
    folder = tmp_path_factory.mktemp("cluster")
    with (
        scheduler(folder) as (_, address),
        worker(address, folder / "1"),
        worker(address, folder / "2"),
    ):
        distributed = pytest.importorskip("distributed")
        with distributed.Client(address, timeout=WAIT_S, set_as_default=False) as client:
            client.wait_for_workers(2, WAIT_S)
        yield address


@pytest.fixture(params=["threads", "cluster"])
def spread(request, monkeypatch):
    place = "threads"
    if request.param == "cluster":
        place = request.getfixturevalue("machines")
    monkeypatch.setenv(ADDRESS_VARIABLE, place)
    with opened() as found:
        yield found


def test_results_are_those_of_a_loop_in_their_order(spread):
    rng = np.random.default_rng()
    shared, items, told = rng.normal(size=(50, 3)), rng.normal(size=40).tolist(), []
    found = spread.run(norm, shared, items, on_done=told.append)
    assert found == [norm(shared, item) for item in items]
    assert told[-1] == 40
    assert told == sorted(told)


def test_nothing_to_do_is_done(spread):
    assert spread.run(norm, 1.0, []) == []


def test_what_a_piece_raises_is_raised(spread):
    with pytest.raises(ArithmeticError, match="piece 3"):
        spread.run(faulty, 3, range(5))


def test_a_piece_that_raises_is_not_begun_again(spread, tmp_path):
    with pytest.raises(ArithmeticError, match="piece 7"):
        spread.run(counted_fault, tmp_path, [7])
    assert len(list(tmp_path.iterdir())) == 1


def test_a_campaign_that_is_called_off_ends_before_all_is_done(spread):
    done = []
    with pytest.raises(CampaignCancelledError):
        spread.run(slow, 0.1, range(1000), on_done=done.append, is_cancelled=lambda: bool(done))
    assert done[-1] < 1000


def test_a_cluster_works_in_other_processes_at_once(machines, tmp_path, monkeypatch):
    monkeypatch.setenv(ADDRESS_VARIABLE, machines)
    with opened() as found:
        assert isinstance(found, Cluster)
        assert found.places == 2
        pids = set(found.run(met_process_of, tmp_path, range(8)))
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_a_comparison_finds_the_same_numbers_on_a_cluster(machines, monkeypatch):
    config = changed(TABLE_3_1_LINEAR, duration_s=20.0, runs=3)
    config = changed(config, disturbance=DisturbanceConfig(parameter_error=0.1))
    found = []
    for address in ("threads", machines):
        monkeypatch.setenv(ADDRESS_VARIABLE, address)
        compared = compare(MINIGLIDER, config, [choice("backstepping"), choice("pid")])
        found.append([result.rms for result in compared.results])
    assert np.array_equal(*found)


def test_a_swarm_finds_the_same_parameters_on_a_cluster(machines, monkeypatch):
    rng = np.random.default_rng(5)  # a flight that can be identified
    recording = open_loop_recording(MINIGLIDER, rng, runs=2, duration_s=30.0, period_s=0.2)
    problem = problem_from(wrong_by(0.15), recording, SMALL)
    found = []
    for address in ("threads", machines):
        monkeypatch.setenv(ADDRESS_VARIABLE, address)
        found.append(run(problem, SMALL).model_dump_json())
    assert found[0] == found[1]


def test_a_machine_that_goes_away_in_the_middle_is_made_up_for(tmp_path, monkeypatch):
    with scheduler(tmp_path) as (_, address), worker(address, tmp_path / "1") as first:
        monkeypatch.setenv(ADDRESS_VARIABLE, address)
        distributed = pytest.importorskip("distributed")
        with distributed.Client(address, timeout=WAIT_S, set_as_default=False) as client:
            client.wait_for_workers(1, WAIT_S)
            with worker(address, tmp_path / "2"):
                client.wait_for_workers(2, WAIT_S)

                def kill(done):
                    if first.poll() is None:
                        # it has done pieces that nobody has looked at
                        wait_until(lambda: len(list(tmp_path.glob("*.done"))) > 20)
                        first.kill()
                        first.wait(WAIT_S)
                        wait_until(lambda: len(client.nthreads()) == 1)

                with opened() as found:
                    assert found.run(noted, tmp_path, range(60), on_done=kill) == list(range(60))
        assert first.poll() is not None


def test_a_scheduler_that_goes_away_is_told(tmp_path, monkeypatch):
    with scheduler(tmp_path) as (process, address), worker(address, tmp_path / "1"):
        monkeypatch.setenv(ADDRESS_VARIABLE, address)
        distributed = pytest.importorskip("distributed")
        with distributed.Client(address, timeout=WAIT_S, set_as_default=False) as client:
            client.wait_for_workers(1, WAIT_S)
        with opened() as found, pytest.raises(ClusterError, match="went away"):
            found.run(slow, 0.1, range(500), on_done=lambda _: process.kill())


def test_a_cluster_without_workers_says_how_to_start_one(tmp_path, monkeypatch):
    with scheduler(tmp_path) as (_, address):
        monkeypatch.setenv(ADDRESS_VARIABLE, address)
        with pytest.raises(ClusterError, match="dask worker"), opened():
            pass


def test_a_worker_of_another_version_is_refused(machines, monkeypatch):
    monkeypatch.setenv(ADDRESS_VARIABLE, machines)
    monkeypatch.setattr(campaign, "_DISTRIBUTION", "numpy")
    with pytest.raises(ClusterError, match="install the same"), opened():
        pass


def test_nobody_at_the_address_is_told_with_the_way_out(monkeypatch):
    monkeypatch.setattr(campaign, "_PATIENCE_S", 0.5)
    monkeypatch.setenv(ADDRESS_VARIABLE, "tcp://127.0.0.1:9")
    with pytest.raises(ClusterError, match="unset GRACE_CLUSTER"), opened():
        pass


def test_a_local_cluster_works_in_processes_of_its_own(monkeypatch):
    monkeypatch.setenv(ADDRESS_VARIABLE, "local")
    with opened() as found:
        pids = found.run(process_of, None, range(4))
    assert os.getpid() not in pids


def test_without_an_address_threads_work(monkeypatch):
    monkeypatch.delenv(ADDRESS_VARIABLE, raising=False)
    with opened() as found:
        assert isinstance(found, Threads)


def test_without_dask_an_address_says_what_to_install(monkeypatch):
    monkeypatch.setenv(ADDRESS_VARIABLE, "local")
    monkeypatch.setattr(campaign, "find_spec", lambda _: None)
    with pytest.raises(ClusterError, match="campaign"), opened():
        pass


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("somewhere", "no address of a cluster"),
        ("http://127.0.0.1:8786", "no address of a cluster"),
        ("tcp://127.0.0.1", "no address of a cluster"),
        ("tcp://127.0.0.1:99999", "no address of a cluster"),
        ("tcp://192.0.2.1:8786", "without TLS"),
    ],
)
def test_an_address_that_may_not_be_used_is_refused(address, words):
    with pytest.raises(ClusterError, match=words):
        check_address(address)


@pytest.mark.parametrize("address", ["tls://192.0.2.1:8786", "tcp://localhost:1", "tcp://[::1]:1"])
def test_an_address_by_tls_or_of_this_machine_may_be_used(address):
    check_address(address)

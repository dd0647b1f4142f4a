"""The store: artifacts are there whole or not at all, and what was changed is never taken for what was made."""

import errno
import hashlib
import itertools
import json
import multiprocessing
import os
import platform
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pipeline.errors import DamagedError, StorageError
from pipeline.store import digest
from pipeline.store import store as store_module
from pipeline.store.store import RECORD, Store
from tests.support import killed_at


def key_of(name):
    """An address as artifacts have them."""
    return hashlib.sha256(name.encode()).hexdigest()


K1, K2 = key_of("k1"), key_of("k2")
ROOT = Path(__file__).resolve().parents[2]
RECORDED = {"name": "a", "version": 1, "parameters": {"x": 1.5}, "inputs": {}, "summary": {"found": [1, 2]}}


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store")


def make(store, key=K1, stage="surface", text="content"):
    """An artifact of two files, one of them in a folder."""
    with store.create(stage, key, RECORDED) as (folder, _):
        (folder / "a.txt").write_text(text)
        (folder / "deep").mkdir()
        (folder / "deep" / "b.bin").write_bytes(bytes(100))
    return store.folder(stage, key)


def everything(folder):
    """All paths below a folder, locks aside."""
    return {path for path in folder.rglob("*") if path.relative_to(folder).parts[0] != "locks"}


# --- made whole or not at all ------------------------------------------------------------------------


def test_an_artifact_has_the_files_that_were_written(store):
    """Its record, summary and files come back, with its size; nothing temporary is left."""
    assert not store.has("surface", K1)
    make(store)
    assert store.has("surface", K1)
    artifact = store.open("surface", K1)
    assert (artifact.stage, artifact.key, artifact.summary) == ("surface", K1, {"found": [1, 2]})
    assert artifact.record["parameters"] == {"x": 1.5}
    assert (artifact.folder / "a.txt").read_text() == "content"
    assert artifact.bytes == len("content") + 100
    assert [found.key for found in store.artifacts()] == [K1]
    assert store.check() == []
    assert list((store.root / "tmp").iterdir()) == []


def test_the_record_can_be_completed_while_writing(store):
    """The seal covers values that a stage adds to the record."""
    with store.create("table", K1, {"name": "a"}) as (_, record):
        record["summary"] = {"terms": 12}
    assert store.open("table", K1).summary == {"terms": 12}


@pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt, MemoryError])
def test_an_error_while_writing_leaves_no_artifact(store, fault):
    """Neither an artifact nor a temporary folder is left, and the fault itself is passed on."""

    def fail():
        with store.create("surface", K1, RECORDED) as (folder, _):
            (folder / "a.txt").write_text("half")
            assert not store.has("surface", K1)
            raise fault

    with pytest.raises(fault):
        fail()
    assert not store.has("surface", K1)
    assert everything(store.root) == {store.root / "tmp"}
    make(store)
    assert store.open("surface", K1).key == K1


def test_nothing_is_visible_before_the_end(store):
    """While an artifact is being written no other reader sees a part of it."""
    with store.create("surface", K1, RECORDED) as (folder, _):
        (folder / "a.txt").write_text("half")
        assert not store.has("surface", K1)
        assert store.artifacts() == []
        assert store.check() == []
    assert store.has("surface", K1)


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o755), (0o077, 0o700), (0o002, 0o775)])
def test_artifacts_are_readable_as_the_umask_says(store, umask, mode):
    """A shared store is shared: folders and files have the modes that any new ones would have."""
    before = os.umask(umask)
    try:
        folder = make(store)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == mode
    assert (folder / RECORD).stat().st_mode & 0o777 == mode & 0o666


def test_the_first_of_two_writers_without_a_lock_stays(store):
    """Machines without a common lock both make it; the second keeps the artifact of the first."""
    with store.create("surface", K1, RECORDED) as (folder, _):
        (folder / "a.txt").write_text("second")
        make(store, text="first")
    assert (store.open("surface", K1).folder / "a.txt").read_text() == "first"
    assert list((store.root / "tmp").iterdir()) == []


def make_once(root, log, coming, count):
    """Does what a run does for one step: waits for the lock, and makes the artifact unless it exists.

    `coming` is a semaphore that counts who comes for the lock: the maker is not done before all `count` have.
    """
    store = Store(root)
    coming.release()
    with store.lock("surface", K1):
        if not store.has("surface", K1):
            with store.create("surface", K1, RECORDED) as (folder, _):
                for _ in range(count):
                    assert coming.acquire(timeout=60.0)
                (folder / "a.txt").write_text("content")
            with log.open("a") as stream:
                stream.write("made\n")
    store.open("surface", K1)


def test_threads_make_an_artifact_once(store, tmp_path):
    """Four that want the same artifact at once: one makes it, the others wait and share it."""
    arguments = (store.root, tmp_path / "log", threading.Semaphore(0), 4)
    threads = [threading.Thread(target=make_once, args=arguments) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (tmp_path / "log").read_text() == "made\n"


def test_processes_make_an_artifact_once(store, tmp_path):
    """The same across processes."""
    context = multiprocessing.get_context("spawn")
    arguments = (store.root, tmp_path / "log", context.Semaphore(0), 3)
    processes = [context.Process(target=make_once, args=arguments) for _ in range(3)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0, 0, 0]
    assert (tmp_path / "log").read_text() == "made\n"


def test_locks_of_different_artifacts_do_not_wait(store):
    """One lock is for one artifact."""
    with store.lock("surface", K1), store.lock("surface", K2), store.lock("stack", K1):
        pass


# --- damage ------------------------------------------------------------------------------------------


def edit_record(folder, **changes):
    record = json.loads((folder / RECORD).read_text())
    (folder / RECORD).write_text(json.dumps({**record, **changes}))


def truncate(path):
    path.write_bytes(path.read_bytes()[:-20])


def sealed_anew(folder, **changes):
    """Changes the record as its owner can: the seal is right."""
    record = {**json.loads((folder / RECORD).read_text()), **changes}
    del record["seal"]
    record["seal"] = digest.of_json(record)
    (folder / RECORD).write_text(json.dumps(record))


def replaced(path, how):
    """Puts a link with the same content, or a pipe, in the place of a file."""
    content = path.read_bytes()
    path.unlink()
    if how == "pipe":
        os.mkfifo(path)
        return
    (path.parent.parent / "elsewhere").write_bytes(content)
    path.symlink_to(path.parent.parent / "elsewhere")


def displaced(folder, how):
    """Puts a file, a link to the same artifact, a link to nothing or a pipe at the artifact's address."""
    moved = folder.rename(folder.with_name("moved"))
    if how == "file":
        folder.touch()
    elif how == "pipe":
        os.mkfifo(folder)
    else:
        folder.symlink_to(moved if how == "link" else "nowhere")


DAMAGES = {
    "changed": (lambda f: (f / "a.txt").write_text("c0ntent"), "a.txt was changed"),
    "emptied": (lambda f: (f / "deep/b.bin").write_bytes(b""), "deep/b.bin was changed"),
    "removed": (lambda f: (f / "deep/b.bin").unlink(), "deep/b.bin is missing"),
    "added": (lambda f: (f / "c.txt").touch(), "c.txt was added"),
    "record edited": (lambda f: edit_record(f, version=2), f"{RECORD} was changed"),
    "record with no number": (lambda f: edit_record(f, version=float("nan")), RECORD),
    "record cut": (lambda f: truncate(f / RECORD), f"{RECORD} cannot be read"),
    "record emptied": (lambda f: (f / RECORD).write_text(""), f"{RECORD} cannot be read"),
    "record a list": (lambda f: (f / RECORD).write_text("[]"), f"{RECORD} cannot be read"),
    "record a number": (lambda f: (f / RECORD).write_text("5"), f"{RECORD} cannot be read"),
    "record binary": (lambda f: (f / RECORD).write_bytes(b"\xff\x00"), f"{RECORD} cannot be read"),
    "record removed": (lambda f: (f / RECORD).unlink(), f"{RECORD} cannot be read"),
    "record of 8 GiB": (lambda f: os.truncate(f / RECORD, 2**33), f"{RECORD} cannot be read"),
    "record deep": (lambda f: (f / RECORD).write_text("[" * 100_000), f"{RECORD} cannot be read"),
    "record a pipe": (lambda f: replaced(f / RECORD, "pipe"), f"{RECORD} cannot be read"),
    "record a link": (lambda f: replaced(f / RECORD, "link"), f"{RECORD} cannot be read"),
    "surrogate": (lambda f: sealed_anew(f, name="\ud800"), f"{RECORD} cannot be read"),
    "files a list": (lambda f: sealed_anew(f, files=[]), f"{RECORD}: files of a wrong type"),
    "files of numbers": (lambda f: sealed_anew(f, files={"a.txt": 7}), f"{RECORD}: files of a wrong type"),
    "bytes a text": (lambda f: sealed_anew(f, files={"a.txt": {"bytes": "7"}}), "files of a wrong type"),
    "summary a number": (lambda f: sealed_anew(f, summary=5), f"{RECORD}: summary of a wrong type"),
    "stage a number": (lambda f: sealed_anew(f, stage=5), f"{RECORD}: stage of a wrong type"),
    "seconds a text": (lambda f: sealed_anew(f, provenance={"seconds": "1"}), "provenance.seconds of a wrong type"),
    "sparse giant": (lambda f: os.truncate(f / "a.txt", 30 * 2**30), "a.txt was changed"),
    "link with equal content": (lambda f: replaced(f / "a.txt", "link"), "a.txt is not a plain file"),
    "pipe": (lambda f: replaced(f / "deep/b.bin", "pipe"), "deep/b.bin is not a plain file"),
    "pipe added": (lambda f: os.mkfifo(f / "more"), "more is not a plain file"),
    "empty folder": (lambda f: (f / "deep/more").mkdir(), "deep/more/ was added"),
    "file at its address": (lambda f: displaced(f, "file"), "expected a folder"),
    "pipe at its address": (lambda f: displaced(f, "pipe"), "expected a folder"),
    "link at its address": (lambda f: displaced(f, "link"), "expected a folder"),
    "dangling link at its address": (lambda f: displaced(f, "dangling"), "expected a folder"),
}


@pytest.mark.parametrize(("damage", "said"), DAMAGES.values(), ids=DAMAGES)
def test_damage_is_found_named_and_removed(store, damage, said):
    """Opening refuses a damaged artifact with the file and the remedy; collecting removes it and it alone."""
    folder = make(store)
    sound = make(store, K2)
    damage(folder)
    with pytest.raises(DamagedError) as error:
        store.open("surface", K1)
    assert said in str(error.value)
    assert str(folder) in str(error.value)
    assert "store collect" in str(error.value)
    (line,) = store.check()
    assert line == str(error.value)
    assert store.has("surface", K1)
    assert store.collect(keep_days=30.0)[0] == 1
    assert not os.path.lexists(folder)
    assert sound.is_dir()
    assert store.check() == []
    make(store)
    assert store.open("surface", K1).key == K1


def test_many_faults_make_one_line(store):
    """Three files are named, the others counted."""
    with store.create("surface", K1, RECORDED) as (folder, _):
        for i in range(9):
            (folder / f"{i}.txt").write_text("content")
    for i in range(9):
        (store.folder("surface", K1) / f"{i}.txt").unlink()
    (line,) = store.check()
    assert "and 6 more" in line
    assert "\n" not in line


def test_an_artifact_under_anothers_key_is_damage(store):
    """A sound folder in the wrong place would give another config's numbers."""
    shutil.copytree(make(store), store.folder("surface", K2))
    with pytest.raises(DamagedError, match=K1):
        store.open("surface", K2)
    assert store.open("surface", K1).key == K1


def test_a_description_reads_the_record_alone(store):
    """Plans look at many artifacts and need no file of theirs; a damaged record is still refused."""
    folder = make(store)
    (folder / "a.txt").write_text("changed")
    assert store.describe("surface", K1).summary == {"found": [1, 2]}
    truncate(folder / RECORD)
    with pytest.raises(DamagedError):
        store.describe("surface", K1)
    assert store.artifacts() == []


# --- collecting --------------------------------------------------------------------------------------


def age(path, days):
    then = time.time() - 86400.0 * days
    os.utime(path, (then, then))


def test_collect_reports_the_freed_bytes(store):
    """The number of folders removed and their bytes; a second time there is nothing."""
    folder = make(store)
    (folder / "a.txt").write_text("another")
    held = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    assert store.collect(None) == (1, held)
    assert store.collect(None) == (0, 0)


def test_collect_keeps_artifacts_that_were_used_recently(store):
    """Age counts from the last use, and only when a number of days is given."""
    for name in ("old", "used", "new"):
        make(store, key_of(name))
    age(store.folder("surface", key_of("old")) / RECORD, 40)
    age(store.folder("surface", key_of("used")) / RECORD, 40)
    store.touch("surface", key_of("used"))
    assert store.collect(None)[0] == 0
    assert store.collect(30.0)[0] == 1
    assert {artifact.key for artifact in store.artifacts()} == {key_of("used"), key_of("new")}


def test_collect_removes_abandoned_folders_only(store):
    """A writer that lives, here or on another machine, keeps its folder; one that is gone or a day old does not."""
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    tmp = store.root / "tmp"
    names = {
        "alive": f"{os.getpid()}@{platform.node()}-a",
        "elsewhere": "1@another-host-b",
        "dead": f"{gone.pid}@{platform.node()}-c",
        "forgotten": "1@another-host-d",
    }
    for name in names.values():
        (tmp / name).mkdir(parents=True)
        (tmp / name / "part").write_text("half")
    age(tmp / names["forgotten"], 2)
    assert store.collect(None) == (2, 8)
    assert {path.name for path in tmp.iterdir()} == {names["alive"], names["elsewhere"]}


def test_an_empty_store_is_sound(store):
    """A store that was never written has nothing to list, to check or to remove."""
    assert (store.artifacts(), store.check(), store.collect(1.0)) == ([], [], (0, 0))
    assert not store.root.exists()


# --- disks that refuse -------------------------------------------------------------------------------


def attempt(root):
    """Locks and makes an artifact of 3 MiB."""
    store = Store(root)
    with store.lock("surface", K1), store.create("surface", K1, RECORDED) as (folder, _):
        for i in range(3):
            (folder / f"{i}.bin").write_bytes(bytes(2**20))


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EACCES, errno.EROFS])
@pytest.mark.parametrize("where", ["write_bytes", "write_text", "mkdir", "rename"])
def test_a_refusal_anywhere_is_one_storage_fault(store, monkeypatch, where, code):
    """The disk may refuse a folder, a file, the record or the last rename: each time nothing stays behind."""
    make(store, key_of("before"))

    def refuse(*_args, **_kwargs):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patched:
        patched.setattr(store_module.Path, where, refuse)
        with pytest.raises(StorageError) as error:
            attempt(store.root)
    assert str(store.root) in str(error.value)
    assert "another" in str(error.value)
    assert not store.has("surface", K1)
    assert list((store.root / "tmp").iterdir()) == []
    assert store.check() == []


def test_other_system_errors_pass_unchanged(store, tmp_path):
    """A file elsewhere that a stage did not find is no fault of the store."""
    with pytest.raises(FileNotFoundError), store.create("surface", K1, RECORDED):
        (tmp_path / "missing").read_text()


@pytest.mark.parametrize("below", ["", "deep/er"])
def test_a_store_below_a_file_is_a_storage_fault(tmp_path, below):
    """A path that runs through a file cannot hold a store."""
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot be written"):
        attempt(tmp_path / "file" / below)


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 1 MiB, where this user may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small file system can be mounted by root only")
    yield disk
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


def test_a_full_disk_is_a_storage_fault(small_disk):
    """A real disk of 1 MiB takes the first artifact, refuses one of 3 MiB and has its space back."""
    store = Store(small_disk / "store")
    make(store, key_of("small"))
    with pytest.raises(StorageError, match="no space left"):
        attempt(store.root)
    assert list((store.root / "tmp").iterdir()) == []
    assert [artifact.key for artifact in store.artifacts()] == [key_of("small")]
    make(store, key_of("another"))
    assert store.check() == []


def test_a_read_only_disk_is_a_storage_fault(small_disk):
    """Existing artifacts can be read; none can be made, and the error has one line."""
    store = Store(small_disk / "store")
    make(store)
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    assert store.open("surface", K1).key == K1
    store.touch("surface", K1)
    for key in (K1, K2):
        with pytest.raises(StorageError, match="cannot be written"), store.lock("surface", key):
            pass
    with pytest.raises(StorageError, match="cannot be written"):
        make(store, K2)


LIMITED = """
import resource, sys
from pathlib import Path
from pipeline.errors import StorageError
from tests.store.test_store import attempt
resource.setrlimit(resource.RLIMIT_FSIZE, (2**19, 2**19))
try:
    attempt(Path(sys.argv[1]))
except StorageError as error:
    sys.exit(error.exit_code)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_limit_on_file_size_is_a_storage_fault(store):
    """Where the system limits the size of files, the run ends with the code for storage and leaves no artifact."""
    command = [sys.executable, "-c", LIMITED, str(store.root)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == StorageError.exit_code, done.stderr
    assert list((store.root / "tmp").iterdir()) == []
    assert store.check() == []


# --- writers that die --------------------------------------------------------------------------------

WRITER = """
import sys
from pathlib import Path
from pipeline.store.store import Store
store, key = Store(Path(sys.argv[1])), sys.argv[2]
with store.lock("surface", key), store.create("surface", key, {"name": "a"}) as (folder, _):
    for name in ("0.bin", "1.bin", "2.bin"):
        (folder / name).write_bytes(bytes(50_000))
        print(name, flush=True)
"""


def write_until(root, count):
    """Runs WRITER until just before its `count`-th change to the disk: exit code, and files it says it wrote."""
    command = [sys.executable, "-c", killed_at(count) + WRITER, str(root), K1]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, -signal.SIGKILL), done.stderr
    return done.returncode, done.stdout.split()


def test_a_killed_writer_leaves_a_clean_store(store):
    """Killed before any of its changes to the disk, a writer leaves temporary files, but no artifact and no lock."""
    seen = set()
    for count in itertools.count(1):
        sound = make(store, K2)
        code, written = write_until(store.root, count)
        if code == 0:
            break
        litter = list((store.root / "tmp").iterdir())
        # what it says it wrote lies there, half an artifact or a whole one without its name
        assert sorted(p.name for each in litter for p in each.glob("*.bin")) == written
        held = sum(path.stat().st_size for path in everything(store.root / "tmp") if path.is_file())
        assert held >= 50_000 * len(written)
        seen.add(len(written))
        assert not store.has("surface", K1)
        assert [artifact.folder for artifact in store.artifacts()] == [sound]
        assert store.check() == []
        # the lock went with its holder, and what it left is in nobody's way
        with store.lock("surface", K1):
            make(store, K1)
        assert store.open("surface", K1).bytes == len("content") + 100
        assert store.collect(None) == (len(litter), held)
        assert list((store.root / "tmp").iterdir()) == []
        assert store.open("surface", K2).folder == sound
        shutil.rmtree(store.root)
    # before its first file, between any two, and with all of them written
    assert seen == {0, 1, 2, 3}
    assert written == ["0.bin", "1.bin", "2.bin"]
    assert store.open("surface", K1).bytes == 150_000

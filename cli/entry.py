"""The entry point of `diffract-bake`: a supervisor that runs the command in a child process and ends it on a signal.

An exception that a signal handler raises cannot end the command at any moment. Inside an import it leaves the import
lock held, so that other threads wait for ever; inside a library it becomes that library's error; while a kernel is
compiled it is not raised at all. A thread that waits for signals needs the interpreter's lock, which compilers and
readers of files hold for seconds, and it cleans up while the work goes on. The supervisor stops the work first, by a
signal that nothing can hold back, and then removes its temporary folders. It also reports a crash in one line.

This module imports only what the supervisor needs: until its first instruction, signals find Python's own handlers.
"""

import contextlib
import errno
import os
import signal
import sys

_ENDED_BY = {
    signal.SIGHUP: "its terminal was closed",
    signal.SIGINT: "interrupted",
    signal.SIGTERM: "terminated",
}
# ends the message of a command that came to its end by itself
_FINISHED = b"finished"


def process() -> None:
    """Runs the command in a child process and ends with its exit code, or with 128 + the number of a signal."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {*_ENDED_BY, signal.SIGCHLD})
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    # nohup ignores SIGHUP for its command; SIGINT ends the background jobs of scripts, too, for which it is ignored
    awaited = {s for s in _ENDED_BY if s != signal.SIGHUP or signal.getsignal(s) is not signal.SIG_IGN}
    _open_standard_streams()
    # written by the command: its temporary folders, and last whether it came to its end
    notes = os.memfd_create("notes")
    # written by libraries, to what is their stderr
    foreign = os.memfd_create("foreign")
    alive, lifeline = os.pipe()
    supervisor = os.getpid()
    command = os.fork()
    if command == 0:
        os.close(lifeline)
        _follow(supervisor, alive)
        _run(notes, foreign)
    os.close(alive)
    while True:
        received = signal.sigwait({*awaited, signal.SIGCHLD})
        if received in _ENDED_BY:
            _kill(command)
            _, status = os.waitpid(command, 0)
            break
        ended, status = os.waitpid(command, os.WNOHANG)
        if ended:
            received = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
            break
    *folders, last = _content(notes).split(b"\0")
    _remove(folders)
    if received in _ENDED_BY:
        _print(f"{_ENDED_BY[signal.Signals(received)]}; finished stages are kept")
        os._exit(128 + received)
    if last != _FINISHED:
        os._exit(_crashed(received, _content(foreign)))
    os._exit(os.waitstatus_to_exitcode(status))


def _open_standard_streams() -> None:
    """Opens /dev/null in place of closed standard streams, so that no other file takes their numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _follow(supervisor: int, alive: int) -> None:
    """Makes this process end when the supervisor does: SIGIO, which ends it, is sent when the pipe is closed."""
    import fcntl

    fcntl.fcntl(alive, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(alive, fcntl.F_SETFL, os.O_ASYNC)
    if os.getppid() != supervisor:
        os._exit(1)


def _run(notes: int, foreign: int) -> None:
    """Runs the command and ends this process, without the interpreter's cleanup.

    The cleanup of hundreds of MB takes a fifth of a second, and nothing depends on it: files are closed and locks
    released where they are used.
    """
    # the keyboard's interrupt reaches this process and its children as well, and the supervisor ends them
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {*_ENDED_BY, signal.SIGCHLD})
    code: str | int | None = 1
    try:
        from cli import console
        from cli.main import main
        from pipeline.store import scratch

        if not os.environ.get("DIFFRACT_BAKE_DEBUG"):
            console.keep_stderr(foreign)
        scratch.announce_to(notes)
        main()
        code = 0
    except SystemExit as done:
        code = done.code
    except BaseException:
        sys.excepthook(*sys.exc_info())
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.flush()
    os.write(notes, _FINISHED)
    # as sys.exit does: None is 0, and a text is a failure
    os._exit(code if isinstance(code, int) else int(code is not None))


def _kill(command: int) -> None:
    """Kills a process and all that it started; stopped first, it starts no more."""
    os.kill(command, signal.SIGSTOP)
    for child in _children(command):
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    os.kill(command, signal.SIGKILL)


def _children(ancestor: int) -> list[int]:
    """Lists the processes below one, from /proc."""
    parents = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            with contextlib.suppress(OSError), open(f"/proc/{name}/stat", "rb") as stream:
                # the name of the program, in brackets, may hold anything
                parents[int(name)] = int(stream.read().rpartition(b")")[2].split()[1])
    found = [ancestor]
    for process in found:
        found += [child for child, parent in parents.items() if parent == process]
    return found[1:]


def _remove(folders: list[bytes]) -> None:
    left = [folder for folder in folders if os.path.lexists(folder)]
    if left:
        import shutil

        for folder in left:
            shutil.rmtree(folder, ignore_errors=True)


def _crashed(received: int, foreign: bytes) -> int:
    """Reports a command that a library has ended, and returns the exit code."""
    from cli.console import escaped

    lines = foreign.decode(errors="replace").split("\n")
    last = escaped(next((line.strip() for line in reversed(lines) if line.strip()), ""))
    if os.strerror(errno.ENOSPC) in last:
        _print(f"error: no space left to write; free some ({last})")
        return 7
    how = "a library ended the process" if not received else f"{signal.Signals(received).name} ended the process"
    if received == signal.SIGKILL:
        _print(f"error: {how}; the system does that where memory is short")
    else:
        _print(f"error: internal fault, please report it: {how}" + (f": {last}" if last else ""))
    return 1


def _content(descriptor: int) -> bytes:
    return os.pread(descriptor, os.fstat(descriptor).st_size, 0)


def _print(line: str) -> None:
    # a progress bar hides the cursor, and may be on the last line
    terminal = "\r\x1b[K\x1b[?25h" if os.isatty(2) else ""
    with contextlib.suppress(OSError):
        os.write(2, f"{terminal}{line}\n".encode())

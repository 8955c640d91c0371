"""What a tracer counts around hostile FMUs: nothing read, changed or sent outside of what is theirs."""

from pathlib import Path

import pytest

from orchestrator.shared.isolation.walls import support
from tests.support.c_fmu import have_compiler
from tests.support.hostile_fmus import World, command
from tests.support.tracer import available, traced

pytestmark = [
    pytest.mark.skipif(not have_compiler(), reason="there is no C compiler"),
    pytest.mark.skipif(bool(support().not_enforced), reason="this kernel has no walls"),
    pytest.mark.skipif(not available(), reason="strace is not installed or not allowed"),
]


@pytest.mark.parametrize("action", ["read", "write", "tcp"])
def test_nothing_gets_through(tmp_path: Path, action: str) -> None:
    world = World(tmp_path / "world")
    try:
        words = command(world, "simulate", world.fmu("step", action), 60.0)
        trace = traced(words, world.folder, world.environment())
    finally:
        world.close()
    assert trace.children == 1
    assert trace.calls > 100
    assert (trace.read, trace.changed, trace.sent) == ([], [], [])


def test_the_tracer_sees_what_gets_through_without_walls(tmp_path: Path) -> None:
    """The same reading of the log, of a process that has its walls up in name only."""
    from tests.support.tracer import _read

    lines = [
        "7 prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, {len=9, filter=0x7f}) = 0",
        '7 openat(AT_FDCWD</a>, "/home/x/precious", O_RDONLY) = 3</home/x/precious>',
        '7 openat(AT_FDCWD</a>, "/home/x/precious", O_WRONLY|O_CREAT, 0666) = 3</home/x/precious>',
        '7 openat(AT_FDCWD</a>, "/home/x/other", O_RDONLY) = -1 EACCES (Permission denied)',
        '7 unlink("/home/x/precious" <unfinished ...>',
        "8 prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, {len=9, filter=0x7f} <unfinished ...>",
        "7 <... unlink resumed>)                  = 0",
        "8 <... prctl resumed>)                   = 0",
        "7 connect(3<socket:[5]>, {sa_family=AF_INET, sin_port=htons(9)}, 16) = 0",
        '7 mkdirat(AT_FDCWD</tmp/t/backlash-cosim-1-jail-x/work>, "d", 0777) = 0',
    ]
    trace = _read(lines, Path("/tmp/t"))
    assert trace.children == 2
    assert [len(trace.read), len(trace.changed), len(trace.sent)] == [1, 2, 1]

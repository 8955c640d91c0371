"""Requests that are hostile, or wrong: refused in a line, and nothing of them stays."""

import asyncio
import http.client
import os
import socket
from pathlib import Path

import pytest

from orchestrator.cli import main
from tests.support.waiting import wait_until
from tests.support.workbench import Served, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

LOG = "time,u,theta_m,theta_l\n" + "\n".join(f"{n / 100},{n % 5 - 2},{n % 7},{n % 7 / 4}" for n in range(300))


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory):
    with workbench(tmp_path_factory.mktemp("workbench") / "session") as found:
        yield found


def files(served: Served) -> set[str]:
    return {path.relative_to(served.folder).as_posix() for path in served.folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/state", {}),
        ("/wrong-token/state", {}),
        ("/{token}", {}),
        ("/{token}x/state", {}),
        ("/{half}/state", {}),
        ("/{token}/state", {"Host": "machine.example:{port}"}),
        ("/{token}/state", {"Host": "127.0.0.1:1"}),
        ("/{token}/state", {"Host": "127.0.0.1"}),
        ("/{token}/state", {"Origin": "http://machine.example"}),
        ("/{token}/state", {"Origin": "null"}),
        ("/{token}/state", {"Origin": "http://127.0.0.1:1"}),
        ("/{token}/state", {"Origin": "https://127.0.0.1:{port}"}),
        ("/{token}/state", {"Sec-Fetch-Site": "cross-site"}),
        ("/{token}/state", {"Sec-Fetch-Site": "same-site"}),
    ],
)
def test_without_token_or_from_elsewhere_nothing_is_answered(served: Served, path: str, headers: dict) -> None:
    known = {"token": served.token, "port": served.port, "half": served.token[:16]}
    status, said = served.ask_raw(
        "GET", path.format(**known), headers={name: value.format(**known) for name, value in headers.items()}
    )
    assert status == 403
    assert said.startswith(b"refused: ")
    assert served.token.encode() not in said


def test_the_page_itself_is_answered(served: Served) -> None:
    status, page = served.ask("GET", "", headers={"Sec-Fetch-Site": "none"})
    assert (status, b"Backlash workbench" in page) == (200, True)
    status, _ = served.ask("GET", "state", headers={"Origin": f"http://127.0.0.1:{served.port}"})
    assert status == 200
    for name in ("main.js", "page.css", "workbench.css"):
        assert served.ask("GET", f"static/{name}")[0] == 200
    for name in ("server.py", "..%2fserver.py", "../guard.py", "../../errors.py"):
        assert served.ask("GET", f"static/{name}")[0] == 404


def test_what_another_site_can_post_is_refused(served: Served) -> None:
    before = files(served)
    job = b'{"command":"check","inputs":["files/a.fmu"]}'
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        origin = {"Origin": "http://machine.example", "content-type": kind}
        assert served.ask("POST", "jobs", job, origin)[0] == 403
        assert served.ask("POST", "jobs", job, {"content-type": kind})[0] == 400
    assert files(served) == before


def test_every_answer_keeps_browsers_from_more(served: Served) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served.port)
    for path in (f"/{served.token}/", f"/{served.token}/state", "/"):
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        assert answer.getheader("x-content-type-options") == "nosniff"
        assert answer.getheader("referrer-policy") == "no-referrer"
        assert answer.getheader("access-control-allow-origin") is None
    connection.close()


def test_it_listens_on_this_machine_alone(served: Served) -> None:
    lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [line[1] for line in lines if line[3] == "0A" and line[1].endswith(f":{served.port:04X}")]
    assert listening == [f"0100007F:{served.port:04X}"]


@pytest.mark.parametrize(
    "name",
    ["../a.csv", "..%2fa.csv", "%2e%2e%2f%2e%2e%2fa.csv", "%2ftmp%2fa.csv", "a%00.csv", ".lock", ".hidden", "-rf", "..",
     "b%5ca.csv", "a%0ab.csv", "c:a.csv", "x" * 300 + ".csv", "%20a.csv"],
)  # fmt: skip
def test_names_that_are_no_plain_names_are_refused(served: Served, name: str) -> None:
    before = files(served)
    status, _ = served.ask("PUT", f"upload/{name}", b"1,2\n")
    assert status in (400, 404)
    assert files(served) == before


def test_a_name_that_is_taken_gets_a_number(served: Served) -> None:
    first = served.ask("PUT", "upload/Prüfstand 7.csv".replace("ü", "%C3%BC").replace(" ", "%20"), b"1")[1]
    second = served.ask("PUT", "upload/Pr%C3%BCfstand%207.csv", b"2")[1]
    assert (first["name"], second["name"]) == ("Prüfstand 7.csv", "Prüfstand 7-2.csv")
    assert (served.folder / first["file"]).read_bytes() == b"1"


def test_a_log_of_two_gigabytes_is_refused_before_it_is_sent(served: Served) -> None:
    before = files(served)
    with socket.create_connection(("127.0.0.1", served.port)) as line:
        head = f"PUT /{served.token}/upload/large.csv HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
        line.sendall(f"{head}Content-Length: 2000000000\r\n\r\n".encode())
        assert b" 413 " in line.recv(200)
    assert files(served) == before


def test_a_stream_without_end_is_cut_off(tmp_path: Path) -> None:
    """Chunks without a stated length are counted; what is too large does not stay."""
    from orchestrator.workbench.session import open_session
    from orchestrator.workbench.settings import WorkbenchSettings
    from orchestrator.workbench.uploads import UploadTooLargeError, save_upload

    session, settings = open_session(tmp_path / "s"), WorkbenchSettings(largest_file=10_000)
    sent = 0

    async def chunks():
        nonlocal sent
        while True:
            sent += 1000
            yield bytes(1000)

    with pytest.raises(UploadTooLargeError):
        asyncio.run(save_upload(session, "endless.csv", chunks(), None, settings))
    assert sent <= 12_000
    assert list(session.files.iterdir()) == []
    full = WorkbenchSettings(largest_session=5)
    with pytest.raises(UploadTooLargeError):
        asyncio.run(save_upload(session, "more.csv", chunks(), 6, full))


def test_answers_do_not_wait_for_each_other() -> None:
    """Headers and body are two packets: held back until the first is acknowledged, each answer takes 40 ms more."""
    from orchestrator.workbench.server import listen

    async def held_back() -> int:
        seen: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            accepted = writer.get_extra_info("socket")
            seen.set_result(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        with listen(0) as listener:
            async with await asyncio.start_server(answer, sock=listener):
                with socket.create_connection(listener.getsockname()):
                    return await seen

    assert asyncio.run(held_back()) == 1


def test_a_connection_that_breaks_off_leaves_nothing(served: Served) -> None:
    before = files(served)
    with socket.create_connection(("127.0.0.1", served.port)) as line:
        head = f"PUT /{served.token}/upload/broken.csv HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
        line.sendall(f"{head}Content-Length: 1000000\r\n\r\n".encode() + bytes(1000))
        wait_until(lambda: files(served) != before)  # the server is at it
    wait_until(lambda: files(served) == before, lambda: files(served) - before)


@pytest.mark.parametrize(
    "reference",
    ["../../etc/passwd", "files/../../../etc/passwd", "%2e%2e/.lock", ".lock", "files/.hidden", "results", "files",
     "/etc/passwd", "files//a.csv", "files/link.csv"],
)  # fmt: skip
def test_files_outside_the_session_are_not_handed_out(served: Served, reference: str) -> None:
    link = served.folder / "files" / "link.csv"
    if not link.is_symlink():
        os.symlink("/etc/passwd", link)
    status, said = served.ask("GET", f"file/{reference}")
    assert status in (400, 404)
    assert b"root:" not in repr(said).encode()


def test_uploads_are_never_shown_as_pages(served: Served) -> None:
    reference = served.ask("PUT", "upload/page.html", b"<script>alert(1)</script>")[1]["file"]
    connection = http.client.HTTPConnection("127.0.0.1", served.port)
    connection.request("GET", f"/{served.token}/file/{reference}")
    answer = connection.getresponse()
    answer.read()
    assert answer.getheader("content-type") == "application/octet-stream"
    assert answer.getheader("content-disposition", "").startswith("attachment")
    assert answer.getheader("content-security-policy") == "sandbox"
    connection.close()


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        ({"command": "sweep", "inputs": [], "options": {"vary": "a.b=range:0:1:5 --trust"}}, "vary"),
        ({"command": "sweep", "inputs": [], "options": {"scheduler": "tcp://a:1"}}, "scheduler"),
        ({"command": "workbench", "inputs": []}, "command"),
        ({"command": ["check"], "inputs": []}, "command"),
        ({"command": "inspect", "inputs": []}, "inputs"),
        ({"command": "estimate", "inputs": [], "options": {"design": "yes"}}, "design"),
        ({"command": "inspect", "inputs": "files/log.csv"}, "inputs"),
        ({"command": "inspect", "inputs": ["/etc/passwd"]}, "file"),
        ({"command": "inspect", "inputs": ["--out=/tmp"]}, "file"),
        ({"command": "inspect", "inputs": [7]}, "inputs"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"out": "x"}}, "out"),
        ({"command": "check", "inputs": ["files/log.csv"], "options": {"trust": True}}, "trust"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"rate": "1 --trust"}}, "rate"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"rate": True}}, "rate"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"part": "--trust"}}, "part"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"resample": "any"}}, "resample"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": {"model": "/etc/passwd"}}, "file"),
        ({"command": "inspect", "inputs": ["files/log.csv"], "options": []}, "options"),
        ({"command": "diagnose", "inputs": ["files/log.csv"], "options": {"effects": "backlash@shaft"}}, "effects"),
        ({"command": "diagnose", "inputs": ["files/log.csv"], "options": {"effects": ["a@b\n--trust"]}}, "effects"),
        ({"command": "diagnose", "inputs": ["files/log.csv"], "options": {"effects": ["backlash", 7]}}, "effects"),
        ([], "object"),
    ],
)
def test_commands_that_are_not_offered_are_refused(served: Served, asked: object, word: str) -> None:
    if not (served.folder / "files" / "log.csv").exists():
        served.ask("PUT", "upload/log.csv", LOG.encode())
    status, said = served.ask("POST", "jobs", asked)
    assert status == 400
    assert word in said["error"]
    assert served.ask("GET", "state")[1]["jobs"] == []


def test_bodies_that_are_no_requests_are_refused(served: Served) -> None:
    header = {"content-type": "application/json"}
    whole = '{"command": "inspect", "inputs": ["files/log.csv"], "options": {"rate": %s}}'
    numbers = [(whole % text).encode() for text in ("NaN", "1e999", "-Infinity", "1" + 400 * "0")]
    for body in (b"", b"{", b"[" * 100_000, b"\xff\xfe", b"NaN", b'"x"', *numbers):
        assert served.ask("POST", "jobs", body, header)[0] == 400
    before = files(served)
    for place, body in (
        ("columns", b'{"file": "files/log.csv", "columns": {"u": {"name": "\\ud800"}}}'),
        ("models", b'{"name": "\\ud800.toml"}'),
        ("scenarios", b'{"stop": 1, "instances": {"\\ud800": {"fmu": "files/log.csv"}}}'),
    ):
        status, said = served.ask("POST", place, body, header)
        assert (status, "Unicode" in said["error"]) == (400, True)
    assert files(served) == before
    assert served.ask("POST", "jobs", b" " * 1_200_000, header)[0] == 413
    assert served.ask("DELETE", "state")[0] == 405
    assert served.ask("POST", "jobs/none/stop", {})[0] == 400


def test_models_say_what_is_wrong_with_them(served: Served) -> None:
    before = files(served)
    for wrong, word in [
        ({"parameters": {"J_m": {"value": -1.0}}}, "J_m"),
        ({"parameters": {"J_m": {"value": "1; import os"}}}, "parameters"),
        ({"parameters": {"nonsense": {"value": 1.0}}}, "nonsense"),
        ({"columns": {"u": {"name]\n[evil": "x"}}}, "must be one of"),
        ({"columns": {"u": {"unit": "furlong"}}}, "unit"),
        ({"columns": {"w": {"unit": "s"}}}, "must be one of"),
        ({"columns": 3}, "columns"),
        ({"base": "../../etc/passwd"}, "file"),
        ({"name": "../x.toml"}, "name"),
    ]:
        status, said = served.ask("POST", "models", wrong)
        assert (status, word in said["error"]) == (400, True), said
    assert files(served) == before


def test_only_one_workbench_uses_a_directory(served: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["workbench", "--no-browser", "--out", str(served.folder)]) == 2
    assert "in use" in capsys.readouterr().err
    assert main(["workbench", "--no-browser", "--port", str(served.port), "--out", f"{served.folder}-2"]) == 2
    assert "must be free" in capsys.readouterr().err
    assert main(["workbench", "--port", "99999"]) == 2


def test_a_look_at_a_log_speaks_of_no_file_that_nobody_has_written(served: Served) -> None:
    assert served.ask("PUT", "upload/look.csv", LOG.encode())[0] == 201
    status, said = served.ask(
        "POST", "columns", {"file": "files/look.csv", "columns": {"theta_m": {"unit": "furlong"}}}
    )
    assert (status, said["error"].startswith("`columns.theta_m.unit` must be one of rad")) == (400, True), said


def test_an_fmu_is_no_log_and_a_log_no_model(served: Served, tmp_path: Path) -> None:
    for name in ("tank.fmu", "tank.SSP", "tank.csv"):
        (tmp_path / name).write_text(LOG)
    fmu, system, log = (served.upload(tmp_path / name) for name in ("tank.fmu", "tank.SSP", "tank.csv"))
    for file in (fmu, system):
        status, found = served.ask("POST", "columns", {"file": file, "columns": {}})
        assert (status, found["error"]) == (400, f"`file` must be a log, but {file} is an FMU or SSP file")
    status, found = served.ask("GET", f"model?file={log}")
    assert status == 400
    assert found["error"].startswith(f"{log}: must be TOML")

"""The served page: who may use it, what it answers, and what abuse costs."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import time
from contextlib import ExitStack
from typing import Any

import pytest

ConnectionClosed = pytest.importorskip("websockets").ConnectionClosed

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def fresh(served: Any) -> None:
    """Other modules show other pipelines on the same page."""
    served.reset()


def get(served: Any, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=10)
    try:
        connection.request("GET", path, headers={"Host": served.host} | headers)
        answer = connection.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    finally:
        connection.close()


# --- who may use it ---------------------------------------------------------------------------------------------------


def test_the_page_says_what_it_may_load(served: Any) -> None:
    status, headers, body = get(served, served.path)
    assert status == 200
    assert b"<title>rendergraph</title>" in body
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-content-type-options"] == "nosniff"
    assert b"<script>" not in body


@pytest.mark.parametrize("path", ["/", "/wrong/", "/wrong/socket", "/index.html", "/wrong/app.js"])
def test_without_the_token_there_is_nothing(served: Any, path: str) -> None:
    status, _, body = get(served, path)
    assert status == 404
    assert b"rendergraph" not in body


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", ""])
def test_another_host_is_refused(served: Any, host: str) -> None:
    assert get(served, served.path, Host=host)[0] in (400, 403)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "file://", "http://127.0.0.1:1", "https://localhost", "http://["]
)
def test_another_page_is_refused(served: Any, origin: str) -> None:
    assert get(served, served.path, Origin=origin)[0] == 403
    with pytest.raises(Exception, match="403"), served.tab(origin=origin):
        pass


def test_a_socket_without_an_origin_is_refused(served: Any) -> None:
    with pytest.raises(Exception, match="403"), served.tab(origin=None):
        pass


def test_a_socket_without_the_token_is_refused(served: Any) -> None:
    with pytest.raises(Exception, match="403"), served.tab(path="/wrong/"):
        pass


@pytest.mark.parametrize(
    "name",
    ["../server.py", "..%2fserver.py", "%2e%2e/server.py", "/etc/passwd", "vendor/../../server.py", "app.js%00", "."],
)
def test_no_path_leads_out_of_the_page(served: Any, name: str) -> None:
    status, _, body = get(served, served.path + name)
    assert status == 404
    assert body == b"not found\n"


# --- what it answers --------------------------------------------------------------------------------------------------


def test_a_page_gets_the_picture_and_all_about_it(served: Any) -> None:
    with served.tab() as tab:
        facts, files = tab.hear("picture", still=True)
        assert facts["size"] == [64, 36]
        assert files["picture"].startswith(b"\x89PNG")


def test_a_change_a_pixel_undo_and_redo(served: Any) -> None:
    with served.tab() as tab:
        before = value(tab)
        tab.say(do="set", path="display.exposure", value=-2)
        assert tab.hear("state", can_undo=True)[0]["edits"] == {"display.exposure": "-2"}
        tab.hear("pipeline")
        assert max(value(tab)) < max(before)
        tab.say(do="undo")
        tab.hear("pipeline")
        assert value(tab) == before
        tab.say(do="redo")
        tab.hear("pipeline")
        tab.say(do="undo")
        tab.hear("pipeline")


def value(tab: Any) -> Any:
    tab.say(do="pixel", x=0.5, y=0.7)
    return tab.hear("pixel")[0]["pixel"]["values"][:3]


def test_a_mistake_is_said_and_the_picture_stays(served: Any) -> None:
    with served.tab() as tab:
        tab.hear("picture", still=True)
        tab.say(do="set", path="light.lookup", value="nobody.lookup")
        while not (problems := tab.hear("problems")[0]["problems"]):
            pass  # none, from before
        (problem,) = problems
        assert problem["code"] == "RG109"
        assert problem["node"] == "light"
        tab.say(do="undo")
        assert tab.hear("problems")[0]["problems"] == []
        tab.hear("picture", still=True)


def test_two_pages_see_one_state(served: Any) -> None:
    with served.tab() as one, served.tab() as two:
        one.say(do="look", port="light.radiance")
        assert two.hear("state", port="light.radiance")
        assert two.hear("picture", port="light.radiance", still=True)[0]["texture"]["semantic"] == "radiance"
        two.say(do="look", port="")
        one.hear("picture", port="", still=True)


def test_what_belongs_to_a_picture_has_its_revision(served: Any) -> None:
    """So the page shows no figure, comparison or value beside another picture, and says while one is being drawn."""
    with served.tab() as tab:
        before = tab.hear("picture", still=True)[0]["revision"]
        tab.say(do="compare", name="forward-prepass")
        against = tab.hear("against")[0]
        assert against["revision"] >= before
        tab.say(do="look", port="light.radiance")
        asked = tab.hear("state", port="light.radiance")[0]["revision"]
        assert asked > against["revision"]
        assert tab.hear("picture", port="light.radiance", still=True)[0]["revision"] == asked
        tab.say(do="pixel", x=0.5, y=0.5)
        assert tab.hear("pixel")[0]["revision"] == asked
        tab.say(do="look", port="")
        tab.say(do="compare", name=None)
        while tab.hear("against")[1]:
            pass  # until the comparison is gone, for the next test


def test_a_drag_is_drawn_without_loss_at_its_end(served: Any) -> None:
    with served.tab() as tab:
        tab.hear("picture", still=True)
        tab.say(do="hold", on=True)
        tab.say(do="camera", orbit=[0.1, 0])
        _, files = tab.hear("picture", still=False)
        assert files["picture"].startswith(b"\xff\xd8")
        tab.say(do="hold", on=False)
        _, files = tab.hear("picture", still=True)
        assert files["picture"].startswith(b"\x89PNG")
        tab.say(do="camera", name="main")
        assert tab.hear("state", moved=False)


def test_a_page_that_goes_in_the_middle_of_a_drag_lets_go(served: Any) -> None:
    with served.tab() as stays:
        stays.hear("picture", still=True)
        with served.tab() as goes:
            goes.say(do="hold", on=True)
            goes.say(do="camera", orbit=[0.1, 0])
            stays.hear("picture", still=False)
        assert stays.hear("picture", still=True)
        stays.say(do="camera", name="main")
        assert stays.hear("state", moved=False)


def test_a_page_that_goes_takes_nothing_out_of_the_hand_of_another(served: Any) -> None:
    with served.tab() as drags:
        drags.hear("picture", still=True)
        drags.say(do="hold", on=True)
        with served.tab() as goes:
            goes.hear("state")
        drags.say(do="camera", orbit=[0.1, 0])
        drags.hear("picture", still=False)
        drags.say(do="hold", on=False)
        drags.say(do="camera", name="main")
        assert drags.hear("state", moved=False)


def test_each_page_is_told_its_own_pixel(served: Any) -> None:
    with served.tab() as one, served.tab() as two:
        one.hear("picture", still=True)
        two.hear("picture", still=True)
        one.say(do="look", exposure=1)  # while that is drawn, both wait
        one.say(do="pixel", x=0.1, y=0.1)
        two.say(do="pixel", x=0.9, y=0.9)
        assert [tab.hear("pixel")[0]["pixel"]["at"] for tab in (one, two)] == [[6, 3], [57, 32]]
        one.say(do="look", exposure=0)
        one.hear("picture", still=True)


def test_what_is_played_goes_on_and_stops(served: Any) -> None:
    with served.tab() as tab:
        tab.say(do="frame", number=7)
        tab.hear("picture", frame=7)
        tab.say(do="play", on=True)
        assert tab.hear("picture", still=False)[0]["frame"] < tab.hear("picture", still=False)[0]["frame"]
        tab.say(do="play", on=False)
        tab.say(do="frame", number=1)
        tab.hear("picture", frame=1, still=True)


def test_a_variant_is_saved_where_view_was_started_and_never_over_another(served: Any) -> None:
    with served.tab() as tab:
        tab.hear("pipeline")  # that of before
        tab.say(do="set", path="display.exposure", value=1)
        tab.hear("pipeline")
        tab.say(do="save", name="brighter.yaml")
        tab.hear("saved")
        assert (served.folder / "brighter.yaml").read_text().startswith("rendergraph: 1\nextends: forward\n")
        tab.say(do="save", name="brighter.yaml")
        assert tab.hear("refused")[0]["problems"][0]["code"] == "RG531"
        tab.say(do="drop", path="display.exposure")
        tab.hear("pipeline")


ELSEWHERE = [
    "../out.yaml",
    "/tmp/out.yaml",
    "a/b.yaml",
    ".hidden.yaml",
    "x.py",
    "x.yaml\n",
    "",
    None,
    ["x.yaml"],
    "x\0.yaml",
]


def test_nothing_is_saved_elsewhere(served: Any) -> None:
    before = set(served.folder.parent.rglob("*"))
    with served.tab() as tab:
        for name in ELSEWHERE:
            tab.say(do="save", name=name)
            assert "plain name" in tab.hear("refused")[0]["problems"][0]["text"], name
    assert set(served.folder.parent.rglob("*")) == before


def test_it_is_compared_with_shipped_pipelines_and_snapshots(served: Any) -> None:
    with served.tab() as tab:
        tab.say(do="remember")
        assert tab.hear("against")[0]["figures"]["rmse"] == 0
        tab.say(do="compare", name="shading-phong")
        assert tab.hear("against", name="shading-phong")[0]["figures"]["rmse"] > 0
        tab.say(do="compare", name="/etc/passwd")
        assert tab.hear("refused")
        tab.say(do="compare", name=None)
        assert tab.hear("against")[1] == {}


# --- abuse ------------------------------------------------------------------------------------------------------------


def heard_out(tab: Any) -> None:
    """Everything that there still is to hear."""
    while True:
        tab.socket.recv(timeout=10)


def alive(served: Any) -> None:
    with served.tab() as tab:
        tab.hear("picture", timeout=20.0)


@pytest.mark.parametrize(
    "message",
    [
        {"do": "nonsense"},
        {"do": "set", "path": "../x", "value": 1},
        {"do": "set", "path": "a.b", "value": "x" * 30_000},
        {"do": "set"},
        {"do": "set", "path": "display.type", "value": "../other.frag"},
        {"do": "set", "path": "display.type", "value": {"nodes": {"a": {"type": "/other.frag"}}}},
        {"do": "set", "path": 1, "value": 1},
        {"do": "camera", "orbit": ["nan", 0]},
        {"do": "camera", "orbit": [1]},
        {"do": "camera", "zoom": [0]},
        {"do": "camera", "name": {"x": 1}},
        {"do": "frame", "number": "x"},
        {"do": "look", "port": "$(rm)"},
        {"do": "look", "port": 5},
        {"do": ["set"]},
        {},
    ],
)
def test_malformed_messages_are_refused_in_words(served: Any, message: dict[str, Any]) -> None:
    with served.tab() as tab:
        tab.say(**message)
        assert "Traceback" not in json.dumps(tab.hear("refused")[0])
    alive(served)


def test_a_number_beyond_any_is_refused_in_words(served: Any) -> None:
    with served.tab() as tab:
        tab.socket.send('{"do": "frame", "number": 1e999}')
        assert "Number out of range" in tab.hear("refused")[0]["problems"][0]["text"]


@pytest.mark.parametrize("text", ["{", "[]", "1", "[" * 5_000, '{"do": "undo"' + " " * 70_000 + "}", "\x00"])
def test_what_is_no_message_ends_its_socket_alone(served: Any, text: str) -> None:
    with served.tab() as bystander:
        with served.tab() as tab:
            tab.socket.send(text)
            with pytest.raises(ConnectionClosed, match=r"1007|1009"):
                heard_out(tab)
        bystander.say(do="pixel", x=0.5, y=0.5)
        bystander.hear("pixel")


def test_a_flood_ends_its_socket(limited: Any) -> None:
    with limited.tab() as tab:
        for _ in range(300):
            with contextlib.suppress(ConnectionClosed):
                tab.socket.send('{"do": "undo"}')
        with pytest.raises(ConnectionClosed, match="1008"):
            heard_out(tab)
    alive(limited)


@pytest.mark.nightly
def test_a_page_that_reads_nothing_holds_up_nobody(served: Any) -> None:
    with served.tab() as deaf, served.tab() as tab:
        for number in range(2, 30):
            tab.say(do="frame", number=number)
            tab.hear("picture", frame=number)
        del deaf
        tab.say(do="frame", number=1)
        tab.hear("picture", frame=1)


def test_connections_that_send_nothing_are_closed(limited: Any) -> None:
    with ExitStack() as stack:
        silent = [stack.enter_context(socket.create_connection(("127.0.0.1", limited.port))) for _ in range(300)]
        silent[0].sendall(b"GET / HTTP/1.1\r\nHost:")
        time.sleep(1.5)
        silent[0].settimeout(5.0)
        with contextlib.suppress(ConnectionResetError):
            assert silent[0].recv(10) == b""
    alive(limited)


def test_one_page_too_many_is_refused(limited: Any) -> None:
    with ExitStack() as stack:
        tabs = [stack.enter_context(limited.tab()) for _ in range(3)]
        with pytest.raises(Exception, match=r"403|1013|too many"), limited.tab() as one_more:
            one_more.socket.recv(timeout=5)
        tabs[0].say(do="pixel", x=0.5, y=0.5)
        tabs[0].hear("pixel")
    alive(limited)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_messages_do_not_wait_for_each_other(host: str) -> None:
    """The loop turns Nagle's algorithm off for connections that name their protocol; it delays a picture by 40 ms."""
    from rendergraph.viewer.server import _bind  # needs the extra

    with _bind(host, 0) as bound:
        assert bound.proto == socket.IPPROTO_TCP

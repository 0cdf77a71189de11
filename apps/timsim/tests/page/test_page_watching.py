"""Those who may only watch: they turn their camera, and whatever else they send changes nothing."""

import time

import msgspec
import pytest
from page_clients import CAMERA, alive, client, fields, get, send, socket, update

from motorgrad.pages import COOKIE
from patience import until
from timsim import live
from timsim.page._server import read_message
from timsim.scene import own, own_elements, watches
from timsim.scene._own import _own


def of(page, connection):
    """viser's handle of a browser, once its elements are there; one that has gone may still be there, too."""

    def handles():
        known = dict(page.server._websock_server._live_connections)
        port = connection.local_address[1]
        numbers = [number for number, each in known.items() if each.remote_address[1] == port]
        return [each for number, each in page.server.get_clients().items() if number in numbers]

    assert until(handles)
    (found,) = handles()
    assert until(lambda: page.view.cameras.chosen(found.client_id) and len(own_elements(found)) > 5)
    return found


@pytest.mark.ci
def test_the_second_address_leads_to_a_place_of_its_own(page):
    token, place = page._gate.watching
    status, headers, _ = get(page, f"/{token}/")
    assert (status, headers["location"]) == (303, f"/{place}/")
    cookie = headers["set-cookie"].split(";")[0]
    assert page._gate.token not in str(headers)
    status, _, text = get(page, f"/{place}/", Cookie=cookie)
    assert status == 200
    assert "watching only" in text
    assert page._gate.token not in text
    assert get(page, f"/{page._gate.place}/", Cookie=cookie)[0] == 403
    assert "watching only" not in get(page, f"/{page._gate.place}/", Cookie=f"{COOKIE}={page._gate.token}")[2]


def state(page):
    """Everything that a stranger might change."""
    session = page.session
    now = session.snapshot()
    values = {handle._impl.uuid: handle.value for handle in fields(page)}
    layers = [layer.shown for layer in page.scene.layers]
    run = (now.decision, now.playing, now.frozen, now.reset_count, len(now.position), session.speed, session.settings)
    return run, values, layers, page.overlay.shown, len(session.log), page.panels.panels["Capture"]._scene


def orders(page):
    """Every message by which a page makes something happen."""
    gui = page.server.gui
    for uuid, handle in gui._gui_input_handle_from_uuid.items():
        other = not handle.value if isinstance(handle.value, bool) else handle.value
        for value in (other, 0.5, [0.5], "Play", "Reset", "x.npz", True):
            yield {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
    for uuid in gui._container_handle_from_uuid:
        yield {"type": "GuiFormSubmitMessage", "uuid": uuid}
        yield {"type": "GuiFormDirtyMessage", "uuid": uuid}
    for uuid in gui._command_handle_from_uuid:
        yield {"type": "CommandTriggerMessage", "uuid": uuid}
    where = {
        "ray_origin": (0.0, 0.0, 0.0),
        "ray_direction": (0.0, 0.0, 1.0),
        "screen_pos": (0.5, 0.5),
        "modifier": None,
    }
    for name in page.server.scene._handle_from_node_name:
        yield {"type": "SceneNodeClickMessage", "name": name, "instance_index": 0, "owner": "", **where}
    yield {"type": "GetRenderResponseMessage", "payload": b"x", "render_uuid": "x"}
    yield {"type": "ShareUrlRequest"}


def test_nothing_that_a_watching_browser_sends_changes_anything(page, quiet):
    """As a rogue client would: every order that there is, of every kind."""
    before = state(page)
    sent = [*orders(page)]
    assert len(sent) > 100
    with client(page, url=page.read_only_url) as connection:
        found = of(page, connection)
        for message in sent:
            send(connection, **message)
        # the last is its camera, which is heard, and so the others have been read
        send(connection, **{**CAMERA, "position": (1.0, 2.0, 3.0)})
        assert until(lambda: tuple(found.camera.position) == (1.0, 2.0, 3.0))
        time.sleep(0.3)  # callbacks run in threads
        assert state(page) == before
    # and the same by one who drives
    with client(page) as connection:
        of(page, connection)
        speed = page.panels.panels["Run"]._speed
        update(connection, speed, [0.25])
        assert until(lambda: page.session.speed == 10**0.25)
    page.session.order(live.Speed(1.0))
    assert sum("may only watch" in line for line in quiet()) == 1
    assert alive(page)


def test_it_chooses_its_own_camera_and_no_elses(page):
    with client(page) as other, client(page, url=page.read_only_url) as connection:
        assert until(lambda: len(page.server.get_clients()) == 2)
        theirs, mine = (page.server.get_clients()[number] for number in sorted(page.server.get_clients()))
        assert until(lambda: all(page.view.cameras.chosen(each.client_id) for each in (theirs, mine)))
        choices = [page.view.cameras._viewers[each.client_id].choice for each in (theirs, mine)]
        update(connection, choices[0], "Follow")  # the other's
        update(connection, choices[1], "Walk")
        assert until(lambda: page.view.cameras.chosen(mine.client_id) == "Walk")
        assert page.view.cameras.chosen(theirs.client_id) == "Orbit"
        with pytest.raises(TypeError, match="all browsers share"):
            own(page.panels.panels["Run"]._speed)
        assert other.recv()


@pytest.mark.ci
def test_a_class_leaves_room_for_who_drives(page, quiet, monkeypatch):
    monkeypatch.setattr("timsim.page._server.MAX_CLIENTS", 4)
    assert until(lambda: not page.server._websock_server._live_connections)
    held = [socket(page, page.read_only_url) for _ in range(4)]
    assert until(lambda: len(page.server._websock_server._live_connections) == 4)
    late = socket(page, page.read_only_url)
    assert until(lambda: quiet() == ["a browser was refused: 4 are connected"])
    for connection in (held.pop(), late):
        connection.close()
    assert until(lambda: len(page.server._websock_server._live_connections) == 3)
    held.append(socket(page))  # the last place is not for watching
    assert until(lambda: len(page.server._websock_server._live_connections) == 4)
    for connection in held:
        connection.close()
    assert until(lambda: not page.server._websock_server._live_connections)


def go(page, connection, text):
    """Come to the page with what stands behind the # of its address, as the page's script says it."""
    found = of(page, connection)
    assert until(lambda: found.client_id in page.links._fields)
    field = page.links._fields[found.client_id]
    send(connection, type="GuiUpdateMessage", uuid=field._impl.uuid, updates={"value": f"1:{text}"})
    return found


@pytest.mark.ci
def test_a_link_leads_to_a_moment_and_a_camera_and_for_who_watches_to_the_camera_alone(page):
    session = page.session
    session.order(live.Step(30))
    assert until(lambda: session.snapshot().newest >= 30)
    end = session.snapshot().decision
    link = page.link(decision=10, camera="walk", tab="Run")
    assert link == f"{page.url}#decision=10&camera=walk&tab=Run"
    fragment = link.partition("#")[2]
    with client(page, url=page.read_only_url) as connection:
        found = go(page, connection, fragment)
        assert until(lambda: page.view.cameras.chosen(found.client_id) == "Walk")
        time.sleep(0.3)
        assert session.snapshot().decision == end
    with client(page) as connection:
        found = go(page, connection, fragment)
        assert until(lambda: session.snapshot().decision == 10)
        assert until(lambda: page.view.cameras.chosen(found.client_id) == "Walk")
    with client(page) as connection:
        go(page, connection, f"time={20 * session.period}")
        assert until(lambda: session.snapshot().decision == 20)
    # a moment that is yet to come is waited for
    with client(page) as connection:
        go(page, connection, f"decision={end + 40}")
        assert until(lambda: page.links._waiting == end + 40)
        session.order(live.Step(100))
        assert until(lambda: session.snapshot().decision == end + 40)
        assert not session.snapshot().playing
        for nonsense in ("decision=-3", "decision=x", "camera=no", "time=nan", "a=b", "%00", "decision=1&time=1"):
            send(
                connection,
                type="GuiUpdateMessage",
                uuid=page.links._fields[of(page, connection).client_id]._impl.uuid,
                updates={"value": f"2:{nonsense}"},
            )
        time.sleep(0.3)
        assert session.snapshot().decision == end + 40
    with pytest.raises(ValueError, match="camera"):
        page.link(camera="no")
    with pytest.raises(ValueError, match="time = 2"):
        page.link(decision=1, time=2.0)
    assert page.link(camera="orbit", read_only=True) == f"{page.read_only_url}#camera=orbit"


ODD = [
    *({name: value} for name in ("image_height", "image_width") for value in (-1, 2**16, 2**63)),
    *({"fov": value} for value in (0.0, -1.0, 3.15, 1e308)),
    *({"near": near, "far": far} for near, far in ((0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, 1e300))),
    *({"wxyz": value} for value in ((0.0,) * 4, (1e9, 0.0, 0.0, 0.0))),
    *({"up_direction": value} for value in ((0.0,) * 3, (0.0, 0.0, 1e300))),
    *({name: (0.0, 0.0, value)} for name in ("position", "look_at") for value in (1e10, float("inf"), float("nan"))),
]


@pytest.mark.parametrize("odd", ODD, ids=str)
def test_a_camera_that_no_browser_has_is_refused(odd):
    with pytest.raises(ValueError, match="|".join(odd)):
        read_message(msgspec.msgpack.encode({**CAMERA, **odd}))


def test_a_hidden_or_failing_watcher_takes_no_camera_from_who_drives_and_comes_later(page, caplog):
    """A picture without height, then a fault of the program in the camera of that very browser."""
    messages = {"image_height": 0}, {"image_width": 0, "image_height": 0}
    with socket(page, page.read_only_url) as watcher:
        for message in messages:
            send(watcher, **{**CAMERA, **message})
        assert until(lambda: page.server.get_clients())
        (hidden,) = page.server.get_clients()
        assert until(lambda: hidden in page.view.cameras._viewers)
        page.view.cameras._viewers[hidden].wanted = "Walk"
        with client(page) as driver:
            theirs = the_other(page, hidden)
            assert until(lambda: page.view.cameras.chosen(theirs.client_id))
            assert page.view.cameras.chosen(hidden) == ""
            assert page.viewpoint()
            # from here it shows something, and its camera fails
            page.view.cameras._viewers[hidden].wanted = None
            page.view.cameras._viewers[hidden].mode = object()
            send(watcher, **CAMERA)
            assert until(lambda: page.view.cameras._guard.failures)
            choice = page.view.cameras._viewers[theirs.client_id].choice
            update(driver, choice, "Walk")
            assert until(lambda: page.view.cameras.chosen(theirs.client_id) == "Walk")
    (record,) = [each for each in caplog.records if "could not be drawn" in each.getMessage()]
    assert f"browser {hidden}" in record.getMessage()


def the_other(page, number):
    """viser's handle of the browser that has come beside this one."""
    assert until(lambda: len(page.server.get_clients()) == 2)
    (found,) = (each for each in page.server.get_clients().values() if each.client_id != number)
    return found


def test_a_watcher_moves_its_own_elements_within_their_ends_alone(page, quiet):
    with client(page, url=page.read_only_url) as connection:
        found = of(page, connection)
        sliders = [each for each in own_elements(found).values() if hasattr(each, "min")]
        assert sliders
        for slider in sliders:
            for value in (slider.min - 1, slider.max + 1, 1e300, -(2**63), float("nan"), [1.0], None):
                update(connection, slider, value)
            update(connection, slider, slider.max)
            assert until(lambda each=slider: each.value == each.max)
    assert len(quiet()) == 7 * len(sliders)


def test_the_sky_of_who_drives_is_no_watchers(page):
    with client(page), client(page, url=page.read_only_url) as connection:
        assert until(lambda: len(page.server.get_clients()) == 2)
        send(connection, **{**CAMERA, "near": 0.01, "far": 0.02})
        watcher = next(each for number, each in page.server.get_clients().items() if watches(page.server, number))
        assert until(lambda: watcher.camera.far == 0.02)
        (sky,) = (layer for layer in page.scene.layers if hasattr(layer, "_dome"))
        pose = page._pose
        sky.draw(pose)
        assert sky._far > 1.0


def test_a_list_of_keys_that_is_asked_for_again_and_again_is_kept_once(page, quiet):
    """viser keeps what a browser has opened until it leaves."""
    with client(page, url=page.read_only_url) as connection:
        found = of(page, connection)
        assert until(lambda: any(getattr(each, "label", "") == "Keys (?)" for each in own_elements(found).values()))
        button = next(each for each in own_elements(found).values() if getattr(each, "label", "") == "Keys (?)")
        for _ in range(100):
            update(connection, button, True)
        send(connection, **{**CAMERA, "position": (1.0, 2.0, 4.0)})
        assert until(lambda: tuple(found.camera.position) == (1.0, 2.0, 4.0))
        assert len(found.gui._modal_handle_from_uuid) == 1
        assert len(own_elements(found)) == len(_own[found])
    assert quiet() == []

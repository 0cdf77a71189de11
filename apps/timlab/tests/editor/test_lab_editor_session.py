"""Sessions: several clients, lost connections, files, and work that outlives its process."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import pytest
from editor_clients import Client

import timlab
from timlab import gallery
from timlab.editor import Session
from timlab.editor._views import view
from ways_in import assert_short, calls_to


@pytest.fixture
def start(tmp_path):
    """Sessions that are closed in the end."""
    opened = []

    def begin(diagram=None, **options):
        opened.append(Session(diagram, **{"folder": tmp_path, "states": tmp_path / "states"} | options))
        return opened[-1]

    yield begin
    for session in opened:
        session.close()


def shown(session):
    return json.loads(json.dumps(view(session.diagram)))


def test_two_clients_share_a_session(start):
    session = start()
    one, two = Client(session, "one"), Client(session, "two")
    one.do("add", at=[], type="gain", position=[1, 2])
    two.do("add", at=[], type="scope")
    one.do("connect", at=[], source="gain", target="scope")
    two.do("group", at=[], names=["gain"])
    one.do("undo")  # of what the other did
    two.last("changed")
    assert one.view == two.view == shown(session)
    assert one.revision == two.revision == 5


def test_an_operation_is_done_once_however_often_it_is_sent(start):
    session = start()
    client = Client(session)
    first = client.do("add", at=[], type="gain")
    assert client.ask("add", sequence=client.sequence, at=[], type="gain") == first
    refused = client.ask("remove", at=[], names=["nothing"])
    assert client.ask("remove", sequence=client.sequence, at=[], names=["nothing"]) == refused
    other = Client(session, "another")  # whose numbers are its own
    other.sequence = 1
    other.do("add", at=[], type="gain")
    assert list(session.diagram.nodes) == ["gain", "gain 2"]


def test_after_a_lost_connection_nothing_is_lost_and_nothing_twice(start):
    session = start()
    client = Client(session)
    client.do("add", at=[], type="gain")
    client.end()  # what follows is not heard of
    text = client.message("add", at=[], type="scope")
    session.handle(text, lambda event: None)
    Client(session, "another").do("add", at=[], type="sum")
    client.end = session.listen(client.inbox.put)
    client.do("hello", session=session.id, revision=client.revision)
    session.handle(text, client.inbox.put)  # unanswered, so sent again
    client.until(lambda event: event["event"] == "done" and event["sequence"] == client.sequence - 1)
    assert sorted(session.diagram.nodes) == ["gain", "scope", "sum"]
    assert client.view == shown(session)


def test_who_is_up_to_date_is_not_sent_the_document_again(start):
    session = start()
    client = Client(session)
    client.do("add", at=[], type="gain")
    client.seen.clear()
    client.do("hello", session=session.id, revision=client.revision)
    assert client.last("document") is None
    client.do("hello", session="of another process", revision=client.revision)
    assert client.last("document")


def test_declarations_have_all_that_forms_and_palettes_need(start):
    client = Client(start())
    told = client.wait(lambda event: event["event"] == "declarations")
    assert set(told["blocks"]) == {*timlab.BLOCKS, "diagram"}
    assert {name for names in told["categories"].values() for name in names} == set(told["blocks"])
    rate = next(field for field in told["blocks"]["sgd"]["fields"] if field["name"] == "learning_rate")
    assert (rate["role"], rate["low"], rate["high"], rate["default"]) == ("parameter", 0.0, None, 1e-3)
    assert all(block["help"] for block in told["blocks"].values())
    assert {entry["name"] for entry in told["gallery"]} == set(gallery.GALLERY)
    assert all(entry["title"] and len(entry["comment"]) > 50 for entry in told["gallery"])
    for entry in told["gallery"]:  # each has a small picture: every block and every wire
        diagram = timlab.example(entry["name"])
        assert (len(entry["boxes"]), len(entry["wires"])) == (len(diagram.nodes), len(diagram.wires))


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "null", "{", '{"op": "undo"}', '{"client": "a", "op": "undo"}', "[" * 100_000, "9" * 10_000),
        '{"client": "a", "sequence": 1, "op": "set", "at": [], "field": "tick", "value": NaN}',
        *('{"client": "a", "sequence": true, "op": "undo"}', '{"client": "a", "sequence": 1}'),
    ],
)
def test_messages_that_make_no_sense_are_refused(start, text):
    answers = []
    session = start()
    session.handle(text, answers.append)
    assert [answer["event"] for answer in answers] == ["refused"]
    assert not session.diagram.nodes


def test_files_are_saved_opened_and_never_lost(start, tmp_path):
    client = Client(start())
    assert "has none yet" in client.ask("save")["message"]
    client.do("open", gallery="chain")
    client.do("set", at=[], field="title", value="Mine")
    client.do("save", file="mine")
    assert timlab.load(tmp_path / "mine.json").title == "Mine"
    assert client.last("saved")["saved"]
    client.do("files")
    assert client.last("files")["files"] == ["mine.json"]
    other = Client(start())
    assert "confirm to replace it" in other.ask("save", file="mine.json")["message"]
    other.do("open", file="mine.json")
    other.do("set", at=[], field="title", value="Theirs")
    other.do("save")
    client.do("set", at=[], field="comment", value="later")
    assert "unchanged since it was opened" in client.ask("save")["message"]  # it was replaced meanwhile
    client.do("save", over=True)
    assert timlab.load(tmp_path / "mine.json").title == "Mine"
    outside = tmp_path.parent / "outside.json"
    timlab.save(timlab.Diagram(), outside)
    (tmp_path / "link.json").symlink_to(outside)
    for name in ("../out", "/tmp/x", "a/b", ".hidden", "", "x" * 300, "link"):
        assert client.ask("save", file=name)["event"] == "refused"
    (tmp_path / "spoilt.json").write_text('{"format": "motorgrad diagram", "version": 1, "blocks": {"a": {}}}')
    before = client.session.diagram
    assert "unknown type of block None" in client.ask("open", file="spoilt.json")["message"]
    assert client.session.diagram == before
    client.do("text")
    assert timlab.loads(client.last("text")["text"]) == before
    client.do("text", python=True)
    assert client.last("text")["text"].startswith("import timlab")


WORK = """
import json, sys, time
from pathlib import Path
import timlab
from timlab.editor import Session
session = Session(file=Path(sys.argv[1]) if sys.argv[1] else None, states=Path(sys.argv[2]))
operations = [dict(op="add", at=[], type="gain", position=[1, 2]), dict(op="add", at=[], type="scope"),
    dict(op="connect", at=[], source="gain", target="scope"), dict(op="add", at=[], type="sum"), dict(op="undo"),
    dict(op="parameter", address="gain.gain", value=0.1 + 0.2), dict(op="group", at=[], names=["gain"])]
for n, operation in enumerate(operations):
    session.handle(json.dumps({"client": "a", "sequence": n, **operation}), lambda event: None)
print(json.dumps(timlab.dumps(session.diagram)), flush=True)
time.sleep(600)
"""


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_unsaved_work_survives_a_killed_process(start, tmp_path, process_environment, named):
    file = tmp_path / "work.json" if named else None
    process = subprocess.Popen(
        [sys.executable, "-c", WORK, str(file or ""), str(tmp_path / "states")],
        stdout=subprocess.PIPE,
        text=True,
        env=process_environment,
    )
    assert process.stdout is not None
    diagram = timlab.loads(json.loads(process.stdout.readline()))
    living = Client(start(file=file))
    assert living.last("recoverable")["list"] == []  # it is still worked on
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    client = Client(start(file=file), "after")
    (found,) = client.last("recoverable")["list"]
    assert found["changes"] == 7
    client.do("recover", id=found["id"])
    assert client.session.diagram == diagram
    assert client.last("recoverable")["list"] == []
    client.do("undo")  # as if it had not been recovered
    assert not client.session.diagram.nodes
    client.do("redo")
    if named:
        client.do("save")
        assert timlab.load(file) == diagram
        client.session.close()
        assert sorted(path.name for path in tmp_path.iterdir() if path.suffix == ".journal") == []


def test_a_journal_that_was_cut_off_is_recovered_as_far_as_it_goes(start, tmp_path):
    session = start()
    client = Client(session)
    for _ in range(3):
        client.do("add", at=[], type="gain")
    session.close()
    (journal,) = (tmp_path / "states").glob("*.journal")
    journal.write_bytes(journal.read_bytes()[:-9])
    after = Client(start())
    (found,) = after.last("recoverable")["list"]
    assert found["changes"] == 2
    after.do("recover", id=found["id"])
    assert list(after.session.diagram.nodes) == ["gain", "gain 2"]
    assert "unknown journal" in after.ask("recover", id="../other")["message"]


def test_work_that_is_not_wanted_is_dropped_and_saved_work_leaves_no_journal(start, tmp_path):
    client = Client(start())
    client.do("add", at=[], type="gain")
    client.session.close()
    after = Client(start())
    (found,) = after.last("recoverable")["list"]
    after.do("recover", id=found["id"], drop=True)
    assert not list((tmp_path / "states").glob("*.journal"))
    after.do("add", at=[], type="gain")
    after.do("save", file="kept")
    after.session.close()
    assert not list((tmp_path / "states").glob("*.journal*"))


def test_opening_another_diagram_loses_no_unsaved_work_and_no_file(start, tmp_path):
    timlab.save(timlab.Diagram(title="Mine"), tmp_path / "mine.json")
    client = Client(start())
    client.do("add", at=[], type="gain")
    client.do("open", file="mine.json")
    client.session.close()
    after = Client(start(file=tmp_path / "mine.json"))
    (found,) = after.last("recoverable")["list"]
    after.do("recover", id=found["id"])
    assert list(after.session.diagram.nodes) == ["gain"]
    assert "has none yet" in after.ask("save")["message"]  # it was no work on that file
    assert timlab.load(tmp_path / "mine.json").title == "Mine"
    after.session.close()  # and again it is not saved
    again = Client(start())
    (found,) = again.last("recoverable")["list"]
    again.do("recover", id=found["id"])
    assert list(again.session.diagram.nodes) == ["gain"]


def test_what_a_killed_server_left_half_done_is_cleaned_up(tmp_path):
    file, states = tmp_path / "work.json", tmp_path / "states"
    states.mkdir()
    living = Session(file=file, states=states)
    Client(living).do("add", at=[], type="gain")
    for name in (".work.json.partial", ".work.json.7.journal.lock", "states/2026-01-01.journal.lock"):
        (tmp_path / name).touch()
    session = Session(file=file, states=states)
    names = [path.name for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(names) == [".work.json.journal", ".work.json.journal.lock"]  # those of the living session
    session.close(keep=False)
    living.close(keep=False)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == []


class Jumping:
    """The `time` module on a machine whose clock is set again and again."""

    def __init__(self, chance):
        self.chance = chance

    def __getattr__(self, name):
        return getattr(time, name)

    def time(self):
        return time.time() + self.chance.uniform(-1e9, 1e9)


def test_a_clock_that_jumps_changes_neither_undo_nor_what_is_recovered(tmp_path, monkeypatch):
    for module in ("_session", "_storage", "_branch", "_runner", "_tree"):
        monkeypatch.setattr(f"timlab.editor.{module}.time", Jumping(random.Random(0)), raising=False)
    diagram = timlab.Diagram()
    diagram.add("sine", timlab.Sine())
    session = Session(diagram, folder=tmp_path, states=tmp_path / "states")
    client = Client(session)
    for value in (2.0, 3.0, 4.0):
        client.do("parameter", address="sine.amplitude", value=value)
    client.do("tick", n=5)
    client.do("undo")  # changes of one parameter in quick succession are one, whatever the clock says
    assert session.diagram == diagram
    client.do("redo")
    for _ in range(10):
        client.do("add", at=[], type="scope")
    wanted = session.diagram
    session.close()
    after = Session(folder=tmp_path, states=tmp_path / "states")
    client = Client(after)
    (found,) = client.last("recoverable")["list"]
    client.do("recover", id=found["id"])
    assert after.diagram == wanted
    after.close(keep=False)


def journal_of(start, tmp_path, number):
    """The journal of a session that ended with unsaved work: so many blocks."""
    before = {*(tmp_path / "states").glob("*.journal")}
    session = start()
    client = Client(session)
    for _ in range(number):
        client.do("add", at=[], type="gain")
    session.close()
    (journal,) = {*(tmp_path / "states").glob("*.journal")} - before
    return journal


NO_CHANGES = ["5", "[]", '"do"', "{", "null", '{"do": 1}', '{"diagram": 2}', "[" * 5000, '{"do": {"op": "save"}}']
NO_CHANGES += ['{"do": {"op": "add", "at": [], "type": "nothing"}}', '{"diagram": "{}"}', "\x00\xff", "1" * 5000, ""]


@pytest.mark.parametrize("bad", NO_CHANGES, ids=range(len(NO_CHANGES)))
def test_one_bad_line_hides_no_unsaved_work(start, tmp_path, bad):
    """As it fell to who could write a line into one of the journals: all others, and what came before it, are there."""
    spoilt, sound = (journal_of(start, tmp_path, number) for number in (3, 2))
    lines = spoilt.read_bytes().split(b"\n")
    spoilt.write_bytes(b"\n".join([*lines[:3], bad.encode("latin-1"), *lines[3:]]))
    client = Client(start())
    assert {each["id"]: each["changes"] >= 2 for each in client.last("recoverable")["list"]} == {
        spoilt.name: True,
        sound.name: True,
    }
    client.do("recover", id=spoilt.name)
    assert list(client.session.diagram.nodes) == ["gain", "gain 2"]
    assert "line 4" in client.last("error")["message"]
    client.do("recover", id=sound.name)
    assert list(client.session.diagram.nodes) == ["gain", "gain 2"]


@pytest.mark.parametrize("head", ["", "5", "{}", '{"format": "motorgrad journal"}', '{"file": 5, "diagram": "{}"}'])
def test_a_file_that_is_no_journal_is_named_and_kept(start, tmp_path, head):
    spoilt, sound = (journal_of(start, tmp_path, number) for number in (3, 2))
    spoilt.write_bytes(head.encode() + b"\n" + spoilt.read_bytes().partition(b"\n")[2])
    client = Client(start())
    assert [each["id"] for each in client.last("recoverable")["list"]] == [sound.name]
    assert spoilt.name in client.last("error")["message"]
    assert spoilt.exists()


def test_what_is_no_regular_file_is_named_and_not_opened(start, tmp_path):
    """A pipe would never answer, and a link leads elsewhere."""
    sound = journal_of(start, tmp_path, 2)
    os.mkfifo(sound.with_name("0.journal"))
    sound.with_name("1.journal").mkdir()
    sound.with_name("2.journal").symlink_to(sound)
    os.mkfifo(sound.with_name("3.journal.lock"))
    client = Client(start())
    assert [each["id"] for each in client.last("recoverable")["list"]] == [sound.name]
    said = " ".join(event["message"] for event in client.seen if event["event"] == "error")
    assert all(f"{number}.journal" in said for number in range(3))
    for number in (0, 2):
        assert "regular file" in client.ask("recover", id=f"{number}.journal")["message"]
    client.do("recover", id=sound.name)
    assert list(client.session.diagram.nodes) == ["gain", "gain 2"]


def test_a_title_with_another_end_of_line_cuts_nothing_off(start, tmp_path):
    client = Client(start())
    for title in ("one\u2028two", "three\x85four"):
        client.do("set", at=[], name=None, fields={}, field="title", value=title)
    client.do("add", at=[], type="gain")
    client.session.close()
    after = Client(start())
    (found,) = after.last("recoverable")["list"]
    assert (found["changes"], found["title"]) == (3, "three\x85four")


def add_lines(journal, *changes, **head):
    """Write further changes to a journal, and other values to its first line."""
    first, *rest = journal.read_text().splitlines()
    lines = [json.dumps(json.loads(first) | head), *rest, *map(json.dumps, changes)]
    journal.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("field", [[], {}, ["title"]])
def test_a_title_of_another_type_hides_no_unsaved_work(start, tmp_path, field):
    spoilt, sound = (journal_of(start, tmp_path, number) for number in (3, 2))
    add_lines(spoilt, {"do": {"op": "set", "at": [], "field": field, "value": 1, "fields": {}}})
    client = Client(start())
    assert {each["id"] for each in client.last("recoverable")["list"]} == {spoilt.name, sound.name}
    client.do("recover", id=spoilt.name)
    assert len(client.session.diagram.nodes) == 3


@pytest.mark.parametrize("trust", [False, True])
def test_code_in_unsaved_work_does_not_run_unasked(start, tmp_path, trust):
    """Not in a notebook, either, whose page may run what is written there: a journal may be a stranger's file."""
    ran = tmp_path / "ran"
    source = f"open({str(ran)!r}, 'w').close()\ndef step(memory, time):\n    return 1.0\n"
    fields = {"source": source, "takes": []}
    journal = journal_of(start, tmp_path, 1)
    add_lines(
        journal,
        {"do": {"op": "remove", "at": [], "names": ["gain"]}},
        {"do": {"op": "add", "at": [], "type": "python function", "name": "theirs", "fields": fields}},
    )
    client = Client(start(trust=trust))
    client.do("recover", id=journal.name)
    assert "nothing of it was run" in client.ask("tick", n=1)["message"]
    assert not ran.exists()
    (told,) = client.session._offers.of(client.session.diagram)
    assert told["offered"] == trust
    if trust:
        client.do("trust", keys=[told["key"]])
        client.do("tick", n=1)
    assert ran.exists() == trust


@pytest.mark.parametrize("name", ["..", ".hidden.json", "other", "\0", "link.json", "\udcff.json"])
def test_unsaved_work_does_not_choose_a_file_that_could_not_be_saved(start, tmp_path, name):
    (tmp_path / "link.json").symlink_to(os.devnull)
    journal = journal_of(start, tmp_path, 1)
    add_lines(journal, file=f"{tmp_path}/{name}")
    client = Client(start())
    client.do("recover", id=journal.name)
    assert client.session._document.now.file is None


@pytest.mark.parametrize("seeds", [["a"], [{}], [-1], [0, 0], [10**30]])
def test_a_log_with_bad_seeds_leaves_those_of_the_run(start, seeds):
    client = Client(start())
    part = {"diagram": timlab.dumps(timlab.Diagram()), "from": 0, "until": 0, "changes": []}
    log = {"format": "motorgrad log", "version": 1, "seeds": seeds, "tick": 0, "parts": [part]}
    assert "seeds" in client.ask("replay", log=log)["message"]
    client.do("pause")
    assert client.last("run")["seeds"] == [0]


def test_a_number_of_a_form_is_near_the_field_that_checks_it(start):
    diagram = timlab.Diagram()
    diagram.add("trace", timlab.EligibilityTrace(size=2))
    session = start(diagram)
    client = Client(session)
    assert_short(calls_to("decay", 0.97, lambda: client.do("parameter", address="trace.decay", value=0.97)))

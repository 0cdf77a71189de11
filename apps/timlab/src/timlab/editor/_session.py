"""A session: a diagram, its history and its run, shared by any number of clients."""

import atexit
import concurrent.futures
import contextlib
import json
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from timlab.compiler import problems
from timlab.diagram import Diagram, DiagramError, dumps, from_a_file, load, loads, to_python
from timlab.editor import _edits as edits
from timlab.editor import _masks as _masks  # its operations
from timlab.editor import _protocol as ask
from timlab.editor._branch import checked_log
from timlab.editor._document import Document
from timlab.editor._protocol import read_message
from timlab.editor._runner import Runner
from timlab.editor._storage import SUFFIX, Folder, Journal
from timlab.editor._trust import Offers
from timlab.editor._views import declarations, difference, shapes, view
from timlab.editor._warnings import warnings
from timlab.gallery import example

Event = dict[str, Any]
Send = Callable[[Event], None]
REMEMBERED = 2000  # answers kept per client, in case it did not receive them
CLIENTS = 200


class Session:
    """The object that clients talk to. Its methods may be called from any thread.

        session = Session(timlab.example("chain"))
        stop = session.listen(print)
        session.handle('{"client": "me", "sequence": 1, "op": "tick", "n": 10}', print)

    **Arguments:**

    - `diagram`: the initial diagram, by default that of `file`, or an empty one.
    - `file`: where it is saved, with a name that ends in `.json`; it need not exist yet.
    - `folder`: where diagrams may be opened and saved, by default the folder of `file`, or the current one.
    - `states`: where unsaved work without a file is kept, by default in the user's state directory.
    - `trust`: let code run that is written in the page: Python functions and Functional Mock-up Units. Whoever has the
      page's address can then run programs. Otherwise the page shows code that a file brought, and asks.
    """

    def __init__(
        self,
        diagram: Diagram | None = None,
        file: Path | None = None,
        folder: Path | None = None,
        states: Path | None = None,
        trust: bool = False,
    ):
        check(file is None or file.suffix == SUFFIX, "file", str(file), f"a name that ends in {SUFFIX}")
        self.id = secrets.token_hex(8)
        self._folder = Folder(folder or (file.parent if file else Path.cwd()))
        self._offers = Offers()
        if diagram is None and file is not None and file.exists():
            diagram = load(file)
            self._offers.add(diagram)
            self._folder.mark_seen(file)
        self._document = Document((diagram or Diagram()).copy(), file)
        self._journal = Journal(file, states)
        self._lock = threading.RLock()
        self._trust = trust
        self._listeners: dict[object, Send] = {}
        self._answers: OrderedDict[str, OrderedDict[int, Event | None]] = OrderedDict()
        self._problems: Event = {
            "event": "problems",
            "revision": -1,
            "list": [],
            "warnings": [],
            "shapes": {},
            "foreign": [],
        }
        self._aside = concurrent.futures.ThreadPoolExecutor(1, "motorgrad-lab-aside")
        self._runner = Runner(self._document.diagram, self._emit)
        atexit.register(self.close)  # compiled code must not run while the interpreter shuts down
        self._find_problems()

    @property
    def diagram(self) -> Diagram:
        """A copy of the current diagram."""
        return self._document.diagram.copy()

    def listen(self, send: Send) -> Callable[[], None]:
        """Send all events to `send`, from any thread. **Returns** a function that stops this."""
        key = object()
        with self._lock:
            self._listeners[key] = send

        def end() -> None:
            with self._lock:
                self._listeners.pop(key, None)

        return end

    def handle(self, text: str, answer: Send) -> None:
        """Perform the operation of a message. The answer may come later, from another thread."""
        try:
            client, sequence, operation = read_message(text)
        except ValueError as error:
            answer(_refused(text, error))
            return
        with self._lock:
            known = self._answers_of(client)
            if sequence in known and not isinstance(operation, ask.Hello):
                before = known[sequence]
                if before is not None:  # otherwise the operation is in progress
                    answer(before)
                return
            known[sequence] = None

            def done(error: Exception | None = None) -> None:
                with self._lock:
                    own = {"client": client, "sequence": sequence, "revision": self._document.revision}
                    known[sequence] = _answer(own, error)
                answer(_answer(own, error))

            try:
                with contextlib.nullcontext() if self._trust else from_a_file(trust=False):
                    if isinstance(operation, ask.Replay):
                        self._open_log_diagram(operation)
                    if isinstance(operation, ask.RunOperation):
                        self._runner.submit(operation, done, answer)
                        return
                    self._do(operation, answer)
            except Exception as error:  # a block's own code may raise anything; its client must be answered
                done(error)
            else:
                done()

    def resend(self, send: Send) -> None:
        """Send one client the state of the run and its recorded signals again."""
        self._runner.greet(send)

    def close(self, keep: bool = True) -> None:
        """Release threads and files; the journal of unsaved work is kept if `keep` is true."""
        atexit.unregister(self.close)
        self._aside.shutdown(cancel_futures=True)
        self._runner.close()
        with self._lock:
            self._journal.close(keep and not self._document.saved)

    def _do(self, operation: ask.Operation, answer: Send) -> None:
        match operation:
            case ask.Hello():
                self._greet(operation, answer)
            case ask.Fragment():
                answer({"event": "fragment", "fragment": edits.selection(self.diagram, operation.at, operation.names)})
            case ask.Text():
                text = (to_python if operation.python else dumps)(self._document.diagram)
                answer({"event": "text", "text": text, "python": operation.python})
            case ask.Files():
                answer({"event": "files", "files": self._folder.names()})
            case ask.Save():
                self._save(operation)
            case ask.Trust():
                self._offers.trust(self._document.diagram, operation.keys)
                self._find_problems()
            case ask.Recover(drop=True):
                self._journal.drop(operation.id)
                self._emit(self._recoverable())
            case _:
                self._change(operation)

    def _change(self, operation: ask.Operation) -> None:
        """Change the document, record the change, and tell all clients."""
        document, before = self._document, self._document.diagram
        file, saved = document.now.file, document.saved
        match operation:
            case ask.Undo():
                document.undo()
            case ask.Redo():
                document.redo()
            case ask.New():
                document.open(Diagram(), None)
            case ask.Open():
                document.open(*self._opened(operation))
            case ask.Recover():
                with from_a_file(trust=False):  # a journal is a file, whatever else this session trusts
                    diagram, own, bad = self._journal.recovered(operation.id)
                if self._trust:
                    self._offers.add(diagram)
                if bad:
                    said = f"recovered up to line {bad} of {operation.id}, which makes no sense"
                    self._emit({"event": "error", "message": said})
                if own == (str(file) if file else None) and saved:
                    document.update(diagram)
                else:
                    here = own is not None and self._folder.contains(Path(own))
                    document.open(diagram, Path(own) if own is not None and here else None, saved=False)
            case edits.SetParameter():
                document.update(operation.apply(before), operation.address, time.monotonic())
            case edits.Change():
                document.update(operation.apply(before))
            case _:
                raise ValueError(f"{operation.op}: is not an operation on the document")
        whole = isinstance(operation, ask.Open | ask.New | ask.Recover)
        if whole or document.now.file != file:  # unsaved work on the previous document can be recovered later too
            self._journal.switch(document.now.file, keep=not saved)
        self._record_change(before, operation)
        if isinstance(operation, ask.Recover):
            self._journal.drop(operation.id)
        if whole:
            self._emit(self._recoverable())
        scopes = list(difference(before, document.diagram))
        self._emit(self._whole() if whole else {"event": "changed", **document.flags, "scopes": scopes})

    def _record_change(self, before: Diagram, operation: ask.Operation) -> None:
        """Write a change to the journal, and update the run and the list of problems."""
        try:
            self._journal.record(before, self._document.diagram, operation)
        except (OSError, ValueError) as error:
            self._emit({"event": "error", "message": f"autosave: {error}"})
        if not isinstance(operation, edits.Move | edits.Comment):  # these do not affect the run
            self._runner.edit(self._document.diagram, isinstance(operation, ask.Open | ask.New))
            self._find_problems()

    def _opened(self, operation: ask.Open) -> tuple[Diagram, Path | None]:
        given = [name for name in ("text", "gallery", "file") if getattr(operation, name) is not None]
        check(len(given) == 1, "open", given, "one of text, gallery and file")
        if operation.file is not None:
            diagram, path = self._folder.load(operation.file)
            if not self._folder.wrote(operation.file):
                self._offers.add(diagram)
            return diagram, path
        if operation.text is not None:
            return loads(operation.text), None
        return example(operation.gallery or ""), None

    def _save(self, operation: ask.Save) -> None:
        file = self._document.now.file
        name = operation.file if operation.file is not None else file.name if file else None
        if name is None:
            raise ValueError("file: must be given: the diagram has none yet")
        path = self._folder.save(self._document.diagram, name, operation.over)
        self._document.mark_saved(path)
        self._journal.switch(path, keep=False)
        self._emit({"event": "saved", **self._document.flags})

    def _greet(self, operation: ask.Hello, answer: Send) -> None:
        """Send a client everything it needs initially, or after a lost connection."""
        self._aside.submit(lambda: answer({"event": "declarations", **declarations()}))
        if (operation.session, operation.revision) != (self.id, self._document.revision):
            answer(self._whole())
        answer(self._problems)
        unsaved, skipped = self._journal.others()
        answer({"event": "recoverable", "list": unsaved})
        for message in skipped:
            answer({"event": "error", "message": message})
        self._runner.greet(answer)

    def _open_log_diagram(self, operation: ask.Replay) -> None:
        """Replace the document with the diagram at the end of a log."""
        part = checked_log(operation.log)["parts"][-1]
        diagram = loads(part["diagram"])
        for change in part["changes"]:
            diagram = edits.SetParameter(change["address"], change["value"]).apply(diagram)
        before, saved = self._document.diagram, self._document.saved
        self._document.open(diagram, None)
        self._journal.switch(None, keep=not saved)
        self._record_change(before, operation)
        self._emit(self._whole())

    def _whole(self) -> Event:
        shown = view(self._document.diagram)
        return {"event": "document", "session": self.id, **self._document.flags, "view": shown}

    def _recoverable(self) -> Event:
        return {"event": "recoverable", "list": self._journal.others()[0]}

    def _find_problems(self) -> None:
        """Find problems with the diagram in the background: a new block type takes a while."""
        revision, diagram = self._document.revision, self._document.diagram

        def find() -> None:
            if revision == self._document.revision:
                try:
                    found = [problem._asdict() for problem in problems(diagram)]
                    quick = [] if found else [warning._asdict() for warning in warnings(diagram)]
                    about = {"list": found, "warnings": quick, "shapes": shapes(diagram)}
                except Exception as error:  # a block's own code may raise anything; nobody would hear of it here
                    said = f"{type(error).__name__}: {' '.join(str(error).split())}"
                    own = {"path": "", "port": None, "message": f"its problems cannot be found: {said}"}
                    about = {"list": [own], "warnings": [], "shapes": {}}
                about["foreign"] = self._offers.of(diagram)
                self._problems = {"event": "problems", "revision": revision, **about}
                self._emit(self._problems)

        self._aside.submit(find)

    def _emit(self, event: Event) -> None:
        with self._lock:
            listeners = list(self._listeners.values())
        for send in listeners:
            send(event)

    def _answers_of(self, client: str) -> OrderedDict[int, Event | None]:
        known = self._answers.setdefault(client, OrderedDict())
        self._answers.move_to_end(client)
        while len(self._answers) > CLIENTS:
            self._answers.popitem(last=False)
        while len(known) > REMEMBERED:
            known.popitem(last=False)
        return known


def _answer(own: Event, error: Exception | None) -> Event:
    if error is None:
        return {"event": "done", **own}
    first = error.problems[0] if isinstance(error, DiagramError) else None
    where = {} if first is None else {"path": first.path, "port": first.port}
    return {"event": "refused", **own, "message": " ".join(str(error).splitlines()), **where}


def _refused(text: str, error: ValueError) -> Event:
    """The answer to a message that cannot be parsed, addressed to its sender if it names one."""
    try:
        data = json.loads(text)
        known = {"client": ask.is_client, "sequence": ask.is_sequence}
        own = {name: data.get(name) if fits(data.get(name)) else None for name, fits in known.items()}
    except (ValueError, AttributeError, RecursionError):
        own = {}
    return {"event": "refused", **own, "message": " ".join(str(error).splitlines())}

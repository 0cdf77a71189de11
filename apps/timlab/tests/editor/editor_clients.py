"""Clients of a session for tests: what a browser's tab would do, without one."""

import json
import queue
import time

TIMEOUT = 600  # seconds; a machine may be busy


class Client:
    """Sends operations to a session and keeps a view, changed by its events alone."""

    def __init__(self, session, name="tester"):
        self.session, self.name, self.sequence = session, name, 0
        self.inbox, self.seen, self.view, self.revision = queue.Queue(), [], None, None
        self.end = session.listen(self.inbox.put)
        self.do("hello")

    def message(self, op, sequence=None, **fields):
        """The text of an operation."""
        if sequence is None:
            self.sequence += 1
        return json.dumps({"client": self.name, "sequence": sequence or self.sequence, "op": op, **fields})

    def ask(self, op, sequence=None, **fields):
        """Send an operation. **Returns** its answer, `done` or `refused`."""
        text = self.message(op, sequence, **fields)
        wanted = json.loads(text)["sequence"]
        self.session.handle(text, self.inbox.put)
        return self.until(lambda e: e["event"] in ("done", "refused") and e.get("sequence") == wanted)

    def do(self, op, **fields):
        """Send an operation that must be done."""
        answer = self.ask(op, **fields)
        assert answer["event"] == "done", answer
        return answer

    def until(self, condition):
        """Take events in until one meets a condition."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            event = json.loads(json.dumps(self.inbox.get(timeout=TIMEOUT), allow_nan=False))
            self._take(event)
            if condition(event):
                return event
        raise TimeoutError

    def wait(self, condition):
        """Take events in until one meets a condition, if none has."""
        self.last("")
        return next((event for event in self.seen if condition(event)), None) or self.until(condition)

    def last(self, kind):
        """The last event of a kind."""
        while not self.inbox.empty():
            self._take(json.loads(json.dumps(self.inbox.get(), allow_nan=False)))
        return next((event for event in reversed(self.seen) if event["event"] == kind), None)

    def run(self):
        """How the run stands, as its events say it."""
        self.last("run")
        found = {}
        for event in self.seen:
            if event["event"] == "run":
                found |= event
        return found

    def log(self, **fields):
        """The log of a branch."""
        self.do("log", **fields)
        return self.last("log")["log"]

    def _take(self, event):
        self.seen.append(event)
        if event["event"] == "document":
            self.view = event["view"]
        elif event["event"] == "changed":
            for scope in event["scopes"]:
                patch(self.view, scope)
        self.revision = event.get("revision", self.revision)


def patch(view, scope):
    """Change a view as an event says."""
    for name in scope["at"]:
        view = view["nodes"][name]["inner"]
    for name in scope.get("removed", []):
        del view["nodes"][name]
    for name, node in scope.get("nodes", {}).items():
        inner = {k: v for k, v in view["nodes"].get(name, {}).items() if k == "inner"} if "inner" not in node else {}
        view["nodes"][name] = {**node, **inner}
    for part in ("wires", "layout", "head"):
        if part in scope:
            view[part] = scope[part]

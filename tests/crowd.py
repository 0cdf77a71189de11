"""Many clients of a page at once, in a process of their own: readers, slow ones, deaf ones, and some that reload."""

import asyncio
import base64
import json
import subprocess
import sys
import time

from websockets.asyncio.client import connect


def crowd(address, first, seconds, *, readers=0, slow=0, deaf=0, reloaders=0, protocols=()):
    """Let clients come, and wait until they have gone.

    **Arguments:** the `address` of a WebSocket; the `first` message of each; for how long they stay; how many read as
    fast as they can, read a message every 0.3 s, read nothing, and connect again and again; the `protocols` they offer.

    **Returns** the numbers of messages that each kind got; of reloaders, the number of visits; and `failed`.
    """
    origin = "/".join(address.replace("ws", "http", 1).split("/")[:3])
    first = first if isinstance(first, bytes) else first.encode()
    asked = {
        "address": address,
        "origin": origin,
        "text": not protocols,
        "first": base64.b64encode(first).decode(),
        "seconds": seconds,
        "protocols": list(protocols),
        "kinds": {"readers": readers, "slow": slow, "deaf": deaf, "reloaders": reloaders},
    }
    done = subprocess.run([sys.executable, __file__], input=json.dumps(asked), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def fair(found):
    """Whether each client of a crowd was served, and no reader much worse than others; pace is the machine's."""
    steady = (sorted(found[kind]) for kind in ("readers", "slow"))
    return all(found["reloaders"]) and all(0 < counts[0] >= 0.5 * counts[len(counts) // 2] for counts in steady)


PATIENCE = 600  # s, for which a client stays that has heard nothing yet


async def visit(asked, until, pause, heard, least=0):
    """One connection, until some time and so many messages; their number is added to what was `heard`."""
    first = base64.b64decode(asked["first"])
    settings = {"origin": asked["origin"], "subprotocols": asked["protocols"] or None, "open_timeout": PATIENCE}
    # a slow client's network holds little
    async with connect(asked["address"], max_size=None, max_queue=4, ping_interval=None, **settings) as connection:
        await connection.send(first.decode() if asked["text"] else first)
        while (left := until + (PATIENCE if heard[0] < least else 0) - time.monotonic()) > 0:
            if pause is None:
                await asyncio.sleep(left)
                break
            try:
                await asyncio.wait_for(connection.recv(), left)
            except TimeoutError:
                break
            heard[0] += 1
            await asyncio.sleep(min(pause, max(0.0, until - time.monotonic())))
        if pause is None or pause > 0:
            connection.transport.abort()  # a proper end would wait until everything has been read


async def behave(asked, kind, failed):
    """One client, of a kind."""
    heard, end = [0], time.monotonic() + asked["seconds"]
    try:
        if kind == "reloaders":
            visits = 0
            while time.monotonic() < end:
                await visit(asked, time.monotonic() + 0.05, 0.0, heard)
                visits += 1
            return visits
        pause, least = {"readers": (0.0, 1), "slow": (0.3, 1), "deaf": (None, 0)}[kind]
        await visit(asked, end, pause, heard, least)
    except Exception as error:
        failed.append(f"{kind}: {type(error).__name__}: {error}")
    return heard[0]


async def all_of(asked):
    failed = []
    kinds = [kind for kind, count in asked["kinds"].items() for _ in range(count)]
    found = await asyncio.gather(*(behave(asked, kind, failed) for kind in kinds))
    counts = {name: [n for kind, n in zip(kinds, found, strict=True) if kind == name] for name in asked["kinds"]}
    return {**counts, "failed": failed}


if __name__ == "__main__":
    print(json.dumps(asyncio.run(all_of(json.loads(sys.stdin.read())))))

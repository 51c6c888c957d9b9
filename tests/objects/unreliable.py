"""A proxy on loopback that hands requests on to a store and spoils some of the answers.

What it does to a request is drawn from a seeded generator, so a run can be repeated. It also keeps an account of every
request: that is how the tests know which bytes were asked for.
"""

import http.client
import random
import socket
import threading
import time
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

FAULTS = ("busy", "dropped", "hanging", "broken", "short", "lost")


@dataclass
class Request:
    """One request and what became of it."""

    method: str
    path: str
    byte_range: str | None
    status: int
    body_bytes: int
    fault: str | None


@dataclass
class Proxy:
    """A store behind a bad line.

    busy     503 before the store hears of it
    dropped  the connection ends without an answer, before the store hears of it
    hanging  no answer for longer than the client waits
    broken   the answer's body ends in the middle
    short    a whole answer, of half the bytes that were asked for
    lost     the store does what it was asked, and the answer never comes
    """

    target: tuple[str, int]
    hang_s: float = 1.5
    share: float = 0.0
    seed: int = 0
    requests: list[Request] = field(default_factory=list)

    def __post_init__(self):
        self.random = random.Random(self.seed)
        self.lock = threading.Lock()
        self.server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self.server.daemon_threads = True
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server.server_port}"

    def spoil(self, share, seed):
        """From now on this share of the requests goes wrong."""
        with self.lock:
            self.share, self.random, self.requests = share, random.Random(seed), []

    def faults(self):
        """How often each fault was injected."""
        found = [request.fault for request in self.requests if request.fault]
        return {fault: found.count(fault) for fault in sorted(set(found))}

    def body_bytes(self, suffix):
        """Bytes of bodies that were sent for objects whose key ends so."""
        got = [r for r in self.requests if r.method == "GET" and r.path.split("?")[0].endswith(suffix)]
        return sum(r.body_bytes for r in got)

    def _draw(self):
        with self.lock:
            return self.random.choice(FAULTS) if self.random.random() < self.share else None

    def _handler(self):
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle_one(self):
                fault = proxy._draw()
                length = int(self.headers.get("Content-Length") or 0)
                body = self.rfile.read(length)
                note = Request(self.command, self.path, self.headers.get("Range"), 0, 0, fault)
                with proxy.lock:
                    proxy.requests.append(note)
                if fault == "busy":
                    note.status = 503
                    self.send_response(503)
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                if fault in ("dropped", "hanging"):
                    time.sleep(proxy.hang_s if fault == "hanging" else 0)
                    return self.hang_up()
                status, headers, content = self.hand_on(body)
                note.status = status
                if fault == "lost":
                    return self.hang_up()
                self.give(note, status, headers, content, fault)

            def hand_on(self, body):
                store = http.client.HTTPConnection(*proxy.target, timeout=60)
                headers = {k: v for k, v in self.headers.items() if k.lower() not in ("connection",)}
                store.request(self.command, self.path, body=body or None, headers=headers)
                answer = store.getresponse()
                content = answer.read()
                store.close()
                return answer.status, answer.getheaders(), content

            def give(self, note, status, headers, content, fault):
                sent = content
                if fault in ("broken", "short") and self.command == "GET":
                    sent = content[: len(content) // 2]
                told = len(sent) if fault == "short" else len(content)
                self.send_response(status)
                for name, value in headers:
                    if name.lower() == "content-length" and self.command == "HEAD":
                        self.send_header(name, value)
                    elif name.lower() not in ("content-length", "transfer-encoding", "connection", "date", "server"):
                        self.send_header(name, value)
                if self.command != "HEAD" and status != 204:
                    self.send_header("Content-Length", str(told))
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(sent)
                    note.body_bytes = len(sent)
                if fault == "broken":
                    self.hang_up()

            def hang_up(self):
                self.close_connection = True
                try:
                    self.connection.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass

            do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = handle_one

            def log_message(self, *_):
                pass

            def finish(self):
                try:
                    super().finish()
                except OSError:
                    pass

        return Handler

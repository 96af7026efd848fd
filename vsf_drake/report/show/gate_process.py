"""The process that stands before Meshcat's server and lets its own pages in only: a script of
Python's library alone.

`python -I gate_process.py PORT HOST INNER` listens on PORT of this machine (0: any free one),
prints which or why not, and hands visitors on to HOST:INNER until its standard input ends. It is a
process of its own because a thread of Python beside Drake may collect what only the main thread
may: a Meshcat that nobody holds any more would end the program.
"""

import contextlib
import http.client
import http.server
import io
import re
import signal
import socket
import sys
import threading
from collections.abc import Callable
from typing import Any


class _Gate(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int, behind: tuple[str, int]) -> None:
        super().__init__(("127.0.0.1", port), _Visit)
        self.behind = behind

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A visitor who left."""


class _Visit(http.server.BaseHTTPRequestHandler):
    server: _Gate
    connection: socket.socket
    rfile: io.BufferedReader

    def do_GET(self) -> None:
        hosts, origins = (self.headers.get_all(name, []) for name in ("Host", "Origin"))
        # Of any port, for one that is handed on from another machine; no name that somebody bent to
        # this one.
        if (
            len(hosts) != 1
            or not re.fullmatch(r"(localhost|127\.0\.0\.1):[0-9]+", hosts[0])
            or origins not in ([], [f"http://{hosts[0]}"])
        ):
            self.send_error(http.HTTPStatus.FORBIDDEN, "Only pages of this server may ask")
        elif self.headers.get("Upgrade", "").lower() == "websocket":
            self._join()
        else:
            self._fetch()

    def _fetch(self) -> None:
        inner = http.client.HTTPConnection(*self.server.behind)
        inner.request("GET", self.path)
        answer = inner.getresponse()
        content = answer.read()
        self.send_response(answer.status)
        for name in ("Content-Type", "Cache-Control"):
            self.send_header(name, answer.getheader(name, ""))
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def _join(self) -> None:
        """Hands on all bytes of a web socket, both ways."""
        with socket.create_connection(self.server.behind) as inner:
            inner.sendall(
                f"{self.requestline}\n{self.headers}".replace("\n", "\r\n").encode("latin-1")
            )
            threading.Thread(target=_pass_on, args=(self.rfile.read1, inner), daemon=True).start()
            _pass_on(inner.recv, self.connection)
        self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Says nothing."""


def _pass_on(read: Callable[[int], bytes], to: socket.socket) -> None:
    with contextlib.suppress(OSError, ValueError):  # one of the two has left
        while piece := read(1 << 16):
            to.sendall(piece)
    with contextlib.suppress(OSError):
        to.shutdown(socket.SHUT_RDWR)


if __name__ == "__main__":
    # Ctrl-C reaches every process of a terminal; the first one decides
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        server = _Gate(int(sys.argv[1]), (sys.argv[2], int(sys.argv[3])))
    except OSError as error:
        print(error.strerror, flush=True)
        sys.exit()
    threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True).start()
    print(server.server_port, flush=True)
    sys.stdin.read()

"""An HTTP server on loopback that answers ranges, and can be as bad as networks are."""

import re
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import md5
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import unquote


@dataclass
class Store:
    """Objects by path, and what goes wrong with the next requests for bytes."""

    objects: dict[str, bytes] = field(default_factory=dict)
    #: Answers with 503; bodies that break off.
    busy: int = 0
    cuts: int = 0
    #: Number of requests after which the object is replaced by another one.
    replaced_after: int | None = None
    #: Refuse all with this code.
    refusal: int | None = None
    #: Requests: method, path and range.
    asked: list[tuple[str, str, tuple[int, int] | None]] = field(default_factory=list)
    sent: int = 0
    url: str = ""
    #: Hashes of objects, each with its object: of a gigabyte one takes seconds.
    etags: dict[int, tuple[bytes, str]] = field(default_factory=dict)

    def etag_of(self, data):
        if id(data) not in self.etags:
            self.etags[id(data)] = data, md5(data, usedforsecurity=False).hexdigest()
        return self.etags[id(data)][1]


@contextmanager
def serving(**objects):
    """Yield a store that is served at its ``url``."""
    store = Store({f"/{name}": data for name, data in objects.items()})

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_HEAD(self):
            answer(self, store, body=False)

        def do_GET(self):
            answer(self, store, body=True)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    store.url = f"http://127.0.0.1:{server.server_port}"
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield store
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def answer(handler, store, *, body):
    found = re.fullmatch(r"bytes=(\d+)-(\d+)", handler.headers.get("Range", ""))
    store.asked.append((handler.command, handler.path, found and (int(found[1]), int(found[2]) + 1)))
    path = unquote(handler.path.partition("?")[0])
    if store.replaced_after is not None and len(store.asked) > store.replaced_after:
        store.objects[path] = store.objects[path][:-1] + b"?"
    if store.refusal is not None or path not in store.objects or (body and store.busy):
        store.busy -= 1 if body and store.busy else 0
        code = store.refusal or (404 if path not in store.objects else 503)
        handler.send_response(code)
        handler.send_header("Content-Length", "0")
        handler.end_headers()
        return
    data = store.objects[path]
    part = data[int(found[1]) : int(found[2]) + 1] if found else data
    handler.send_response(206 if found else 200)
    if found:
        handler.send_header("Content-Range", f"bytes {found[1]}-{int(found[1]) + len(part) - 1}/{len(data)}")
    handler.send_header("Content-Length", str(len(part)))
    handler.send_header("ETag", f'"{store.etag_of(data)}"')
    handler.send_header("Last-Modified", "Mon, 01 Jan 2024 00:00:00 GMT")
    handler.send_header("Accept-Ranges", "bytes")
    handler.end_headers()
    if not body:
        return
    if store.cuts:
        store.cuts -= 1
        handler.wfile.write(part[: len(part) // 2])
        handler.close_connection = True
        return
    handler.wfile.write(part)
    store.sent += len(part)

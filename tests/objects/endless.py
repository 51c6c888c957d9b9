"""A bucket with as many keys as one likes, for listings only: a page of a thousand at a time, made when it is asked for."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

PAGE = 1000
ENTRY = (
    "<Contents><Key>logs/N{:05}/{:08}.parquet</Key><LastModified>2026-11-20T02:00:00.000Z</LastModified>"
    "<ETag>&quot;{:032x}&quot;</ETag><Size>1000000</Size><StorageClass>STANDARD</StorageClass></Contents>"
)


def serve(keys):
    """The address of a server whose bucket holds so many logs."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            asked = parse_qs(urlsplit(self.path).query)
            first = int(asked.get("continuation-token", ["0"])[0])
            last = min(first + PAGE, keys)
            more = f"<NextContinuationToken>{last}</NextContinuationToken>" if last < keys else ""
            entries = "".join(ENTRY.format(i // 1000, i, i) for i in range(first, last))
            text = (
                '<?xml version="1.0" encoding="UTF-8"?><ListBucketResult><Name>fleet</Name><Prefix>logs/</Prefix>'
                f"<KeyCount>{last - first}</KeyCount><MaxKeys>{PAGE}</MaxKeys>"
                f"<IsTruncated>{str(last < keys).lower()}</IsTruncated>{more}{entries}</ListBucketResult>"
            ).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(text)))
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_port}"

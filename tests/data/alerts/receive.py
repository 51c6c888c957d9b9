"""Receives messages on loopback: receive.py COUNT [CODE...] answers with the codes, then with 200, and prints each with its message.

The port is written to the file `port`."""

import http.server
import json
import sys

count, codes = int(sys.argv[1]), [int(code) for code in sys.argv[2:]]


class Receiver(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        message = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        code = codes.pop(0) if codes else 200
        print(code, json.dumps(message, ensure_ascii=False, sort_keys=True), flush=True)
        self.send_response(code)
        self.end_headers()

    def log_message(self, *_):
        pass


server = http.server.HTTPServer(("127.0.0.1", 0), Receiver)
server.timeout = 60
with open("port", "w") as file:
    print(server.server_port, file=file)
for _ in range(count):
    server.handle_request()

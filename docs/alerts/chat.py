#!/usr/bin/env python3
"""Post an alert of Freeplay to an incoming webhook of a chat: the message comes on standard input.

usage: chat.py FILE           (FILE holds the address of the webhook, which is a secret)
"""

import json
import sys
import urllib.request

BADGES = {"act": "\N{LARGE RED CIRCLE}", "plan": "\N{LARGE ORANGE CIRCLE}", "watch": "\N{LARGE YELLOW CIRCLE}"}


def chat(alert: dict) -> dict:
    """The message of an alert. A name must not address everybody in the channel: `<!channel>`, `@all`."""
    text = alert["text"].replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("@", "@\u200b")
    request = alert.get("work_request")
    return {"text": f"{BADGES.get(alert.get('to'), '')} {text}{f' – {request}' if request else ''}".strip()}


if __name__ == "__main__":
    with open(sys.argv[1]) as file:
        address = file.read().strip()
    body = json.dumps(chat(json.load(sys.stdin))).encode()
    request = urllib.request.Request(address, body, {"Content-Type": "application/json"})
    # An answer other than 2xx raises an error: the exit code is 1, and the next run sends the message again.
    urllib.request.urlopen(request, timeout=20).close()

#!/usr/bin/env python3
"""Send an alert of Freeplay as a mail: the message comes on standard input.

usage: mail.py TO FROM        (the program `sendmail` delivers the mail)
"""

import email.message
import email.policy
import json
import subprocess
import sys


def line(text: str) -> str:
    """The text without line feeds."""
    return " ".join(text.split())


def mail(alert: dict, to: str, sender: str) -> email.message.EmailMessage:
    """The mail of an alert. `EmailMessage` refuses line feeds in headers, which a name could bring."""
    one_line = line(alert["text"])
    message = email.message.EmailMessage(policy=email.policy.SMTP)
    message["To"] = to
    message["From"] = sender
    message["Subject"] = f"[freeplay] {one_line[:120]}"
    # The same in every attempt: mail programs show a repeated message once.
    message["Message-ID"] = f"<{alert['id']}@freeplay.invalid>"
    lines = [one_line, ""]
    for unit in alert.get("units", [alert]):
        lines.append(line(f"{unit['state']}: {unit['part_number']} / {unit['serial_number']}, {unit['tail_number']}"))
        why, due = unit.get("statement") or unit["reason"], unit.get("due_utc") or "without a date"
        lines.append("    " + line(f"due {due}; {why}; work request {unit['work_request'] or 'none'}"))
    message.set_content("\n".join(lines) + "\n")
    return message


if __name__ == "__main__":
    to, sender = sys.argv[1:]
    text = mail(json.load(sys.stdin), to, sender).as_bytes()
    # The exit code of `sendmail` decides: anything but 0, and the next run sends the message again.
    sys.exit(subprocess.run(["sendmail", "-t", "-i"], input=text).returncode)

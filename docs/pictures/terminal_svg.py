"""A terminal recording as SVG: python3 terminal_svg.py OUT.svg WIDTH COMMAND...

Runs each command in the working folder, and draws what is typed and printed. Lines appear one after the other; a
viewer without animation shows the last picture. Only the standard library is used.
"""

import fcntl
import html
import os
import pty
import re
import struct
import subprocess
import sys
import termios

COLOURS = {
    "31": "#d1495b", "32": "#66a182", "33": "#edae49", "34": "#5b9bd5", "35": "#b07cc6", "36": "#4bb3c3",
    "90": "#8a97a5", "2": "#8a97a5",
}
INK, PAPER, PROMPT = "#e6ebf0", "#1c2530", "#66a182"
LETTER, LINE, MARGIN = 7.8, 18, 16
# Seconds until a command is typed, and until a line of its output appears.
TYPING, PRINTING = 1.2, 0.08


def spans(line):
    """Text of one line as SVG, with the colours of its escape sequences."""
    parts, style = [], {}
    for piece in re.split(r"(\x1b\[[0-9;]*m)", line):
        if piece.startswith("\x1b["):
            for code in (piece[2:-1] or "0").split(";"):
                if code == "0":
                    style = {}
                elif code == "1":
                    style["font-weight"] = "bold"
                elif code in COLOURS:
                    style["fill"] = COLOURS[code]
        elif piece:
            marks = "".join(f' {name}="{value}"' for name, value in style.items())
            parts.append(f"<tspan{marks}>{html.escape(piece)}</tspan>" if style else html.escape(piece))
    return "".join(parts)


def run(command, width):
    """What a command prints on a terminal of a width."""
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    environment = dict(os.environ, TERM="xterm-256color", COLORTERM="")
    process = subprocess.Popen(command, shell=True, env=environment, stdin=its, stdout=its, stderr=its)
    os.close(its)
    printed = b""
    while True:
        try:
            more = os.read(ours, 65536)
        except OSError:
            break
        if not more:
            break
        printed += more
    process.wait()
    os.close(ours)
    return re.sub(r"\x1b\[[0-9;?]*[A-LN-Za-ln-z]", "", printed.decode()).replace("\r", "").rstrip("\n").split("\n")


def record(commands, width):
    """Lines with the time at which each appears."""
    lines, now = [], 0.0
    for command in commands:
        now += TYPING
        lines.append((now, f"\x1b[32m$\x1b[0m \x1b[1m{command}"))
        for line in run(command, width):
            now += PRINTING
            lines.append((now, line))
        lines.append((now, ""))
    return lines[:-1]


def draw(lines, width):
    """The recording as SVG."""
    across, down = width * LETTER + 2 * MARGIN, len(lines) * LINE + 2 * MARGIN + 14
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {across:.0f} {down}" width="{across:.0f}" '
        f'height="{down}" role="img" aria-label="Terminal: freeplay">\n'
        f'<rect width="100%" height="100%" rx="8" fill="{PAPER}"/>\n'
        '<g fill="#5a6672"><circle cx="18" cy="14" r="5"/><circle cx="36" cy="14" r="5"/>'
        '<circle cx="54" cy="14" r="5"/></g>\n'
        "<style>text{white-space:pre;font:13px ui-monospace,Menlo,Consolas,'DejaVu Sans Mono',monospace}"
        "@media (prefers-reduced-motion:no-preference){text{animation:a .01s both}}"
        "@keyframes a{from{opacity:0}to{opacity:1}}</style>\n"
        f'<g fill="{INK}">\n'
    )
    body = "".join(
        f'<text x="{MARGIN}" y="{MARGIN + 14 + LINE * (k + 1) - 5}" style="animation-delay:{at:.2f}s">'
        f"{spans(line)}</text>\n"
        for k, (at, line) in enumerate(lines)
    )
    return head + body + "</g>\n</svg>\n"


def main():
    out, width, commands = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    lines = record(commands, width)
    with open(out, "w", encoding="utf-8") as file:
        file.write(draw(lines, width))


if __name__ == "__main__":
    main()

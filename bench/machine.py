"""What a measurement is to say about where and with what it was made."""
import os
import subprocess
import time
from pathlib import Path

root = Path(__file__).resolve().parents[1]


def busy_cores():
    """Cores kept busy by others, over two seconds."""
    def idle():
        return sum(float(n) for n in Path("/proc/stat").read_text().split("\n")[0].split()[4:6]) / os.sysconf("SC_CLK_TCK")
    before, began = idle(), time.monotonic()
    time.sleep(2)
    return round(max(0.0, os.cpu_count() - (idle() - before) / (time.monotonic() - began)), 2)


def machine():
    about = {}
    for line in subprocess.run(["lscpu"], capture_output=True, text=True).stdout.splitlines():
        name, _, value = line.partition(":")
        if name in ("Model name", "CPU(s)", "L3 cache"):
            about[name] = value.strip()
    return about


def version(checkout=root):
    git = subprocess.run(["git", "-C", str(checkout), "describe", "--always", "--dirty"], capture_output=True, text=True)
    return git.stdout.strip() or "unknown"

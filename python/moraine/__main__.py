"""The command moraine of an environment that has the package, and python3 -m moraine: those on results are Python, all others are
the program's, which then takes the place of this process. In the sources the launcher ./moraine tells them apart.

Each module named here has arguments(parser) and run(args).
"""
import argparse
import difflib
import importlib
import os
import subprocess
import sys

from . import places

commands = {  # name: (module, what it does)
    "watch": ("watch", "follow a running case: friction, dilation and energy as they grow"),
    "figures": ("figures", "draw the paper's figures of one case, or of several beside each other"),
    "movie": ("movie", "make movies of a case: grain pressures in 3D, and a section with spins and slip"),
    "view": ("view", "write a page that shows the bed in 3D: any field, force chains, water, through time"),
    "report": ("report", "measure the runs of a study and hold them against what was published"),
    "reproduce": ("reproduce", "run a study that is described in cases/, and draw its figures and report"),
    "cases": ("example_cases", "copy the cases that come with the package, to run and to change them"),
}


def for_program(words):
    """Gives these words to the program instead, where it is installed and they are not one of the commands here."""
    program = places.program()
    if not program or words[:1] and words[0] in commands:
        return
    if not words:
        overview = subprocess.run([program], check=True, capture_output=True, text=True).stdout
        print(overview.replace(" watch, figures, movie and view need the launcher ./moraine.", "").replace("./moraine", "moraine"), end="")
        sys.exit(0)
    if words[0] not in ("-h", "--help"):
        os.execv(program, ["moraine", *words])
    subprocess.run([program, "--help"], check=True)
    for name, (_, what) in commands.items():
        print(f"  {name:<27} {what}")
    sys.exit(0)


def main(words=None):
    words = sys.argv[1:] if words is None else words
    for_program(words)
    from .sealed import MissingData  # not before: the program's commands need no NumPy

    parser = argparse.ArgumentParser(prog="moraine", description="Follows, measures and draws results.")
    parsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    options = []  # of the command
    for name, (module, what) in commands.items():
        sub = parsers.add_parser(name, help=what, description=what[0].upper() + what[1:] + ".")
        if name in words[:1]:
            importlib.import_module(f".{module}", __package__).arguments(sub)
            options = list(sub._option_string_actions)
    args, left = parser.parse_known_args(words)
    if left:
        word = next((w for w in left if w.startswith("-")), left[0])
        near = difflib.get_close_matches(word, options, 1)
        print(f"moraine: {word}: {'unknown option of' if word.startswith('-') else 'one word too many for'} {args.command}; "
              + (f"did you mean {near[0]}?" if near else f"see moraine {args.command} --help"), file=sys.stderr)
        return 1
    try:
        return importlib.import_module(f".{commands[args.command][0]}", __package__).run(args) or 0
    except (MissingData, OSError) as why:  # the latter of what cannot be written
        print(f"moraine: {why}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())

import os
import subprocess
import sys
import warnings

import pytest

from evimo import cli
from evimo.cli import COMMANDS, main
from evimo.errors import BadFile, EvimoWarning


@pytest.mark.parametrize("columns", ["0", "1"])
def test_a_terminal_without_columns_is_helped_too(columns):
    """0 is what some shells say that do not know; a single one kept the layout busy without an end."""
    known = os.environ | {"COLUMNS": columns}
    for arguments in (["--help"], ["run", "--help"]):
        called = [sys.executable, "-m", "evimo", *arguments]
        said = subprocess.run(called, capture_output=True, text=True, check=True, env=known, timeout=60)
        assert "Usage: evimo" in " ".join(said.stdout.split())


@pytest.fixture
def command(monkeypatch):
    """Puts a function in the place of `evimo info`."""
    import evimo.cli.info

    def put(function):
        monkeypatch.setattr(evimo.cli.info, "info", function)

    return put


def test_help_lists_every_command_and_loads_nothing_heavy():
    code = (
        "import sys; from evimo.cli import main; code = main(['--help']); "
        "print(sorted({'numpy', 'torch', 'cv2', 'onnxruntime'} & set(sys.modules)), code)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.endswith("[] 0\n")
    assert all(f" {name} " in said for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name, capsys):
    assert main([name, "--help"]) == 0
    assert f"evimo {name}" in capsys.readouterr().out


def test_a_command_tells_more_of_itself_than_the_list_does(capsys):
    main(["run", "--help"])
    assert "estimates.h5" in capsys.readouterr().out.split("Parameters")[0]


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip()[0].isdigit()


@pytest.mark.parametrize("arguments", [["walk"], ["run"], ["run", "x", "--start", "soon"], ["run", "x", "--fast"]])
def test_wrong_arguments_are_two_lines_and_exit_code_2(arguments, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    problem, fix = err.splitlines()
    assert problem.startswith("error: ") and fix.startswith("  try: evimo") and fix.endswith("--help")


def test_our_errors_are_two_lines_and_exit_code_2(command, capsys):
    def fail() -> None:
        raise BadFile("x is empty", fix="another file")

    command(fail)
    assert main(["info"]) == 2
    assert capsys.readouterr().err == "error: x is empty\n  try: another file\n"


def test_a_bug_keeps_its_traceback(command, capsys):
    def fail() -> None:
        raise ZeroDivisionError

    command(fail)
    assert main(["info"]) == 1
    assert "ZeroDivisionError\nthis is a bug of evimo" in capsys.readouterr().err


def test_ctrl_c_is_exit_code_130(command, capsys):
    def fail() -> None:
        raise KeyboardInterrupt

    command(fail)
    assert main(["info"]) == 130
    assert capsys.readouterr().err.startswith("interrupted")


def test_our_warnings_are_one_line_each_and_come_once(command, capsys):
    def warn() -> None:
        for text in ("a guess", "a guess", "another"):
            warnings.warn(text, EvimoWarning, stacklevel=2)

    command(warn)
    assert main(["info"]) == 0
    assert capsys.readouterr().err == "warning: a guess\nwarning: another\n"


def test_the_name_of_a_file_stays_on_its_line(recording, capsys):
    """Whatever letters it has: some would begin a line, or turn a terminal red."""
    path = recording.rename(recording.with_name("a\nb\x1b[31m.txt"))
    assert main(["info", str(path)]) == 0
    assert main(["run", str(path.with_suffix(".raw"))]) == 2
    said = capsys.readouterr()
    assert f"file         {path.parent}/a\\nb\\x1b[31m.txt\n" in said.out
    assert all(line.startswith(("warning: ", "compiling ", "error: ", "  try: ")) for line in said.err.splitlines())
    assert "\x1b" not in said.out + said.err


def test_warnings_of_others_look_as_ever(command):
    def warn() -> None:
        warnings.warn("old", FutureWarning, stacklevel=2)

    command(warn)
    with pytest.warns(FutureWarning, match="old"):
        main(["info"])


def test_a_command_may_return_its_exit_code(command):
    def three() -> int:
        return 3

    command(three)
    assert main(["info"]) == 3


@pytest.mark.parametrize("module", ["evimo", "evimo.cli"])
def test_modules_are_run_too(module):
    said = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == cli.version("evimo")

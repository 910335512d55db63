from cfem.core.progress import progress


def test_plain_lines_when_not_a_terminal(capsys):
    with progress("solve", 3) as advance:
        for _ in range(3):
            advance(1)
    out, err = capsys.readouterr()
    assert out == "" and err == "solve: 3/3, 0 s left\n"


def test_quiet_says_nothing(capsys):
    with progress("solve", 3, quiet=True) as advance:
        advance(3)
    assert capsys.readouterr() == ("", "")

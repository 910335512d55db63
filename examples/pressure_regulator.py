"""A regulator of pressures with text lines over a serial port, as a device of `cfem control`: a template.

    device: {kind: program, command: [python, -P, ../../examples/pressure_regulator.py, --port, /dev/ttyUSB0]}

cfem talks to this program (docs/closed-loop.md, "A device instead of a simulation"), and this program to the regulator,
in lines of ASCII that end with a line feed:

    P2 50.0        set channel 2, counted from 1, to 50.0 kPa
    OK 49.8        its answer: the pressure measured there, kPa
    ERR overload   or why not

Change `set_pressure` to the lines of yours: Alicat and SMC have others, and an Arduino with valves has those that you
give it. `position` is where your tracker belongs. Pressures are those of the scene's chambers, in its order, in MPa.
Whatever ends the run, all channels are vented. A regulator should vent by itself too when it hears nothing."""

import argparse
import json
import signal
import sys

try:
    from serial import Serial  # pip install 'cfem[serial]'
except ModuleNotFoundError:
    sys.exit("needs pyserial: pip install 'cfem[serial]'")

KPA = 1000.0  # in a MPa


class Regulator:
    """A regulator on an open port. port: of pyserial, with a timeout; largest: MPa that any channel is told."""

    def __init__(self, port, largest):
        self.port, self.largest, self.channels = port, largest, 0

    def set_pressure(self, channel, pressure):
        """Pressure (MPa) measured in a channel, counted from 1, after it was told another. RuntimeError, OSError."""
        if not 0 <= pressure <= self.largest:
            raise RuntimeError(f"channel {channel} is told {pressure:g} MPa, and may have 0 to {self.largest:g} MPa")
        line = f"P{channel} {KPA * pressure:.1f}"
        self.port.reset_input_buffer()
        self.port.write(f"{line}\n".encode("ascii"))
        answer = self.port.readline().decode("ascii", "replace").strip()
        if not answer:
            raise RuntimeError(f"the regulator gave no answer to '{line}' within {self.port.timeout:g} s")
        word, _, rest = answer.partition(" ")
        if word == "ERR":
            raise RuntimeError(f"channel {channel} of the regulator reports: {rest[:80]}")
        try:
            if word != "OK":
                raise ValueError
            return float(rest) / KPA
        except ValueError:
            raise RuntimeError(f"the regulator answered '{answer[:80]}' to '{line}', expected OK and kPa") from None

    def vent(self):
        """Lets the pressure out of all channels, those that answer and those that do not."""
        for channel in range(1, self.channels + 1):
            try:
                self.set_pressure(channel, 0.0)
            except (RuntimeError, OSError) as error:
                print(f"venting: {error}", file=sys.stderr)


def position():
    """Where the tracker sees the effectors: a number for each row, mm; None where it sees nothing, or there is none."""
    return None


def answer(regulator, message):
    """Answer to hello or a command."""
    if "hello" in message:
        regulator.channels = len(message["actuators"])
        for channel in range(1, regulator.channels + 1):
            regulator.set_pressure(channel, 0.0)
        return {"ready": True, "version": 1}
    if message["kind"] != "force":
        raise RuntimeError("this regulator sets pressures: take loop.command force")
    measured = [regulator.set_pressure(channel, u) for channel, u in enumerate(message["u"], 1)]
    return {"t": message["t"], "x_e": position(), "lambda_a": measured}


def main():
    """Answers each line of standard input, until told goodbye or left alone."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", required=True, help="the serial port, as /dev/ttyUSB0 or COM3")
    parser.add_argument("--baud", type=int, default=115200, help="bits a second")
    parser.add_argument("--largest", type=float, default=0.2, help="MPa that no channel exceeds")
    parser.add_argument("--within", type=float, default=0.5, help="s in which the regulator must answer")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that `finally` vents
    regulator = None
    try:
        for line in sys.stdin:
            message = json.loads(line)
            if "bye" in message:
                break
            try:
                if regulator is None:
                    port = Serial(options.port, options.baud, timeout=options.within, write_timeout=options.within)
                    regulator = Regulator(port, options.largest)
                said = answer(regulator, message)
            except (RuntimeError, OSError) as error:
                said = {"error": str(error)}
            print(json.dumps(said), flush=True)
    finally:
        if regulator is not None:
            regulator.vent()


if __name__ == "__main__":
    main()

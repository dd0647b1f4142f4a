"""The `diffract-bake` command: finds subcommands, and turns errors into one line and an exit code."""

import importlib
import os
import sys

import click

from cli import console

# command -> module: modules are imported when their command is used, because --help must start fast
_COMMANDS = {
    "run": "cli.bake",
    "plan": "cli.bake",
    "validate": "cli.validate",
    "render": "cli.render",
    "eval": "cli.evaluate",
    "inspect": "cli.inspect",
    "publish": "cli.publish",
    "verify": "cli.publish",
    "bench": "cli.bench",
    "store": "cli.store",
    "doctor": "cli.doctor",
}


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002
        if name not in _COMMANDS:
            return None
        command: click.Command = getattr(importlib.import_module(_COMMANDS[name]), f"{name}_command")
        return command


@click.command(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="diffract-bake")
def cli() -> None:
    """Bake a measured nanostructure into tables of its diffraction.

    A TOML config names an AFM scan (or a synthetic recipe). Baking it makes diffraction tables, BRDF maps with
    measured errors, and a bundle that any shader can use. All stages are cached: a second run computes only what
    has changed.

    \b
    Start here:
      diffract-bake doctor                    is there a device to compute on?
      diffract-bake inspect SCAN              what is in a scan file?
      diffract-bake run configs/scan.toml     bake your own scan
      diffract-bake run configs/elaphe.toml   or a synthetic snake skin

    Results go to stdout, progress to stderr. Exit codes: 0 done, 1 internal fault, 2 usage or config, 3 input file,
    4 accuracy or memory out of reach, 5 no device, 6 damaged store or bundle, 7 cannot write, 130 interrupted,
    143 terminated.
    """


def main() -> None:
    """Runs the command and turns errors into exit codes."""
    # waiting BLAS threads sleep after 2^4 cycles: by default they spin for 2^26, on the cores of the kernels
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")
    try:
        with cli.make_context("diffract-bake", sys.argv[1:]) as context:
            cli.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Exit as done:
        sys.exit(done.exit_code)
    except click.ClickException as error:
        console.usage_error(error)
        sys.exit(2)
    except Exception as error:
        from cli import faults

        sys.exit(faults.report(error))

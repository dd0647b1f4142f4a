"""The `diffract-bake` command: its groups, and faults told in one line with their exit code."""

import importlib
import os
import sys
from typing import Any

import click

# command -> module: a module is imported when its command is asked for, so that --help stays instant
_COMMANDS = {
    "run": "cli.bake",
    "plan": "cli.bake",
    "validate": "cli.bake",
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
    """Finds commands in their modules on demand."""

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
    """Bake a measured nanostructure into light.

    A TOML config names an AFM scan (or a synthetic recipe); from it come diffraction tables, BRDF maps with
    measured errors, and a bundle that any shader can use. Everything is cached: a second run does only what changed.

    \b
    Start here:
      diffract-bake doctor                    is there a device to compute on?
      diffract-bake inspect SCAN              what is in a scan file?
      diffract-bake run configs/scan.toml     bake your own scan
      diffract-bake run configs/elaphe.toml   or a synthetic snake

    Results go to stdout, progress to stderr. Exit codes: 0 done, 1 internal fault, 2 usage or config, 3 scan,
    4 accuracy out of reach, 5 no device, 6 damaged store or bundle, 7 cannot write, 130 interrupted.
    """


def main() -> Any:
    """Entry point: runs the command and turns faults into exit codes."""
    from pipeline.errors import BakeError

    try:
        return cli.main(standalone_mode=False)
    except click.exceptions.Exit as done:
        sys.exit(done.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted; finished stages are kept", err=True)
        sys.exit(130)
    except BakeError as error:
        for line in str(error).splitlines():
            click.echo(f"error: {line}", err=True)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        # the reader of our output went away, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as error:
        if os.environ.get("DIFFRACT_BAKE_DEBUG"):
            raise
        kind = type(error).__name__
        click.echo(
            f"error: internal fault, please report it: {kind}: {error} "
            "(set DIFFRACT_BAKE_DEBUG=1 for the whole traceback)",
            err=True,
        )
        sys.exit(1)

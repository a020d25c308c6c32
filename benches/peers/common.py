"""What the comparisons share: where things lie, how others' programs get there, and how a table is written."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DESIGNS = Path(__file__).resolve().parent / "designs"
PEERS = ROOT / "target" / "peers"
DATA = Path(os.environ.get("FUSION_DATA", ROOT.parent / "shared" / "data"))
CORES = os.cpu_count() or 1


class Missing(Exception):
    """A peer cannot be had or does not work here; the other peers are still compared."""


def run(*command, cwd=None, env=None):
    """Runs a command and returns what it prints. A failure is `Missing`, with the end of its messages."""
    try:
        done = subprocess.run([str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True)
    except OSError as error:
        raise Missing(f"{command[0]}: {error.strerror}") from error
    if done.returncode != 0:
        said = (done.stderr + done.stdout).strip()[-2000:]
        raise Missing(f"`{' '.join(map(str, command))}` failed with code {done.returncode}:\n{said}")
    return done.stdout


def timed(*command, env=None):
    """Runs a command. Returns what it prints, its seconds of processor time and its largest memory [MB]."""
    result = PEERS / "time.txt"
    # The resources of a child are known of the process that waited for it.
    script = (
        "import json, resource, subprocess, sys\n"
        "code = subprocess.run(sys.argv[2:]).returncode\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "json.dump([used.ru_utime + used.ru_stime, used.ru_maxrss / 1024], open(sys.argv[1], 'w'))\n"
        "sys.exit(code)\n"
    )
    printed = run(sys.executable, "-c", script, result, *command, env=env)
    seconds, megabytes = json.loads(result.read_text())
    return printed, seconds, megabytes


def fusion():
    """The command of this project: the variable FUSION, or a release build."""
    if "FUSION" in os.environ:
        return Path(os.environ["FUSION"])
    run("cargo", "build", "--release", "--quiet", "--bin", "fusion", cwd=ROOT)
    return ROOT / "target" / "release" / "fusion"


def python_packages(*packages):
    """Installs packages of PyPI into the environment of the comparisons, which runs this script."""
    run(sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages)


def crate(name, version):
    """The source of a crate of crates.io, as a separate package in a folder that is not committed."""
    folder = PEERS / f"{name}-{version}"
    if not folder.exists():
        asking = PEERS / "asking" / name
        (asking / "src").mkdir(parents=True, exist_ok=True)
        (asking / "src" / "lib.rs").write_text("")
        (asking / "Cargo.toml").write_text(
            f'[package]\nname = "asking"\nedition = "2021"\n[dependencies]\n{name} = "={version}"\n[workspace]\n'
        )
        known = json.loads(run("cargo", "metadata", "--format-version", "1", cwd=asking))
        source = next(Path(p["manifest_path"]).parent for p in known["packages"] if p["name"] == name)
        run("cp", "-r", source, folder)
        with open(folder / "Cargo.toml", "a") as manifest:
            manifest.write("\n[workspace]\n")
    return folder


def cargo_build(folder, *arguments):
    """Builds a package with optimisation. Returns the folder of its programs."""
    target = PEERS / "build"
    run("cargo", "build", "--release", "--quiet", "--target-dir", target, *arguments, cwd=folder)
    return target / "release"


def data_set(name):
    """The folder of a public data set."""
    folder = DATA / name
    if not folder.is_dir():
        raise Missing(f"{folder} is not there; FUSION_DATA names the folder of the data sets")
    return folder


def table(head, rows):
    """A table of Markdown; numbers stand on the right."""
    rule = ["---" if k == 0 else "---:" for k in range(len(head))]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in [head, rule, *rows]) + "\n"


def machine():
    """The processor, for a line under a table of times."""
    names = [line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    return f"{names[0] if names else 'unknown processor'}, {CORES} cores"


def say(text):
    """A line about the progress."""
    print(time.strftime("%H:%M:%S"), text, file=sys.stderr, flush=True)

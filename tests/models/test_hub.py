"""Checkpoints from a hub: fetched from a server that answers as the hub does, once."""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from evaps.models import SHIPPED

COMMIT = "0123456789abcdef0123456789abcdef01234567"
FILES = {
    f"{path.parent.name}/{path.name}": path.read_bytes()
    for path in sorted((SHIPPED / "small" / "encoder").iterdir())
} | {"README.md": b"not fetched"}


ASKED: list[str] = []  # each request has a handler of its own


class Hub(BaseHTTPRequestHandler):
    """The parts of the hub that a snapshot of acme/tiny needs."""

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_GET(self) -> None:
        ASKED.append(f"{self.command} {self.path}")
        path = self.path.partition("?")[0]
        if path.startswith("/api/models/acme/tiny/revision/"):
            siblings = [{"rfilename": name} for name in FILES]
            self._reply(json.dumps({"id": "acme/tiny", "sha": COMMIT, "siblings": siblings}).encode())
        elif path.startswith("/api/models/acme/tiny/tree/"):
            entries = [
                {"type": "file", "path": name, "size": len(content), "oid": hashlib.sha1(content).hexdigest()}
                for name, content in FILES.items()
            ]
            self._reply(json.dumps(entries).encode())
        elif (name := path.removeprefix(f"/acme/tiny/resolve/{COMMIT}/")) in FILES:
            self._reply(FILES[name])
        else:
            self._reply(b"{}", 404)

    def _reply(self, content: bytes, status: int = 200) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("ETag", f'"{hashlib.sha1(content).hexdigest()}"')
        self.send_header("X-Repo-Commit", COMMIT)
        if status == 404:
            self.send_header("X-Error-Code", "RepoNotFound")
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Not on the terminal."""


@pytest.fixture
def hub() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hub)
    ASKED.clear()
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


def fetch(hub: str, home: Path, name: str) -> subprocess.CompletedProcess[str]:
    code = "import sys; from evaps.models import load_encoder, model_folder; f = model_folder(sys.argv[1]);"
    code += "load_encoder(f / 'encoder'); print(f)"
    there = {**os.environ, "HF_ENDPOINT": hub, "HF_HOME": str(home), "HF_HUB_DISABLE_PROGRESS_BARS": "1"}
    return subprocess.run([sys.executable, "-c", code, name], env=there, capture_output=True, text=True)


def test_a_set_of_checkpoints_is_fetched_once(hub: str, tmp_path: Path) -> None:
    for _ in range(2):
        done = fetch(hub, tmp_path, "hub:acme/tiny@main")
        assert done.returncode == 0, done.stderr
        folder = Path(done.stdout.strip())
        assert (folder / "encoder" / "model.safetensors").read_bytes() == FILES["encoder/model.safetensors"]
        assert not (folder / "README.md").exists()
    assert sum("GET" in a and "safetensors" in a for a in ASKED) == 1


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("hub:acme/nothing", "cannot be fetched: "),
        ("hub:no name", "names nothing on the hub; it has to be hub:OWNER/NAME"),
        ("hub:", "names nothing on the hub"),
    ],
)
def test_what_the_hub_does_not_have_is_one_line(hub: str, tmp_path: Path, name: str, what: str) -> None:
    said = fetch(hub, tmp_path, name).stderr.splitlines()
    assert said[-1].startswith(f"evaps.models.checkpoint.CheckpointError: {name} {what}")

"""Commands of the command line in processes of their own, with progress, output, and a way to stop them.

The page has no work of its own: what it runs is the command that it shows.
"""

from __future__ import annotations

import asyncio
import re
import shlex
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from expdesign.requests import Request, command_text

PROGRESS = re.compile(r"\[\s*(\d+)%\] (.*)")  # a line of progress: share and activity
MOST_LINES = 2000  # kept of an output
MOST_JOBS = 2  # at work at once; later ones wait
INTERRUPTED = 130
CLOCK_S = 0.1  # by which times of files lag behind the clock at most


@dataclass(eq=False)
class Job:
    """A command that waits, runs or has ended."""

    request: Request
    folder: Path  # in which it runs
    share: float = 0.0  # of its work that is done
    activity: str = "waiting for its turn"
    lines: list[str] = field(default_factory=list)  # printed
    errors: list[str] = field(default_factory=list)  # lines on what is wrong or stands in the way
    status: int | None = None  # exit status; None before the end
    process: asyncio.subprocess.Process | None = None
    stopped: bool = False  # by the user
    asked_s: float = field(default_factory=time.time)  # when it was asked for

    @property
    def command(self) -> str:
        """As one types it in the folder."""
        return command_text(self.request)

    @property
    def out(self) -> str:
        """Folder of its results, in the folder in which it runs."""
        return str(getattr(self.request, "out", None) or "")

    def wrote(self, name: str) -> bool:
        """Whether a file of the folder is as new as this command."""
        path = self.folder / name
        return path.is_file() and path.stat().st_mtime >= self.asked_s - CLOCK_S

    @property
    def state(self) -> str:
        """In words."""
        if self.status is None:
            return "running" if self.process else "waiting"
        if self.stopped:
            return "stopped, nothing half-written"
        return {0: "done", 2: "the input is wrong", 3: "no answer", INTERRUPTED: "interrupted"}.get(
            self.status, f"failed with status {self.status}"
        )


class Jobs:
    """The commands of a page, the newest first; they go on when a page is closed or loaded again."""

    def __init__(self, folder: Path) -> None:
        """None yet."""
        self.folder, self.all = folder, list[Job]()
        self._turns = asyncio.Semaphore(MOST_JOBS)
        self._tasks = set[asyncio.Task[None]]()

    def start(self, request: Request) -> Job:
        """Run a command in the folder."""
        job = Job(request, self.folder)
        self.all.insert(0, job)
        task = asyncio.get_running_loop().create_task(self._run(job))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return job

    def stop(self, job: Job) -> None:
        """Interrupt a command as Ctrl-C does."""
        if job.status is None:
            job.stopped = True
            if job.process is None:
                job.status, job.activity = INTERRUPTED, "stopped"
            else:
                job.process.send_signal(signal.SIGINT)

    async def end(self) -> None:
        """Stop all commands, when the page is closed for good."""
        for job in self.all:
            self.stop(job)
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _run(self, job: Job) -> None:
        async with self._turns:
            if job.status is not None:
                return
            job.activity = "starting"
            job.process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", *shlex.split(job.command)),
                cwd=self.folder,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
            )
            await asyncio.gather(_read(job.process.stdout, job, False), _read(job.process.stderr, job, True))
            job.status = await job.process.wait()
            job.stopped = job.stopped and job.status != 0
            job.activity = job.state
            job.share = 1.0 if job.status == 0 else job.share


async def _read(stream: asyncio.StreamReader | None, job: Job, progress: bool) -> None:
    """Take lines in as they come; progress and errors come on another stream than results."""
    while stream is not None and (line := await stream.readline()):
        text = line.decode(errors="replace").rstrip()
        if progress and (told := PROGRESS.match(text)):
            job.share, job.activity = int(told[1]) / 100.0, told[2]
        elif progress and text.startswith("expdesign: "):
            job.errors.append(text.removeprefix("expdesign: "))
        elif len(job.lines) < MOST_LINES:
            job.lines.append(text)
        elif len(job.lines) == MOST_LINES:
            job.lines.append("(further lines are not kept here)")

"""The file of one run: records in SQLite, each with a checksum, added one by one.

What was added is there after a crash of the process, whole or not at all, and on the disk within a
second. A changed bit, a lost, a doubled and a moved record can all be found, and what is damaged
takes few others with it: pages are so small that they hold hardly more than one record, and each
can be read without the others.

Source: Koopman (2002), 32-bit cyclic redundancy codes for Internet applications, Proc. Int. Conf.
Dependable Systems and Networks, 459-468: up to three changed bits of 11 kB are always found, as are
up to 32 in a row in a text of any length; other damage but for one case in 4e9.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
import threading
import zlib
from collections.abc import Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct

from femubench.core.errors import InputError
from femubench.core.files import MIB, check_regular, read_bytes
from femubench.core.schema.records import decode_result, meta_from_json, parse_json
from femubench.core.schema.results import JobResult
from femubench.core.schema.validation import read_plain

Kind = Literal["run", "result", "end"]
Row = tuple[int, str, str, str, bytes, int]

# The second is that of a message which quotes damaged text.
_DAMAGE = (sqlite3.Error, UnicodeError)
LARGEST = 4096 * MIB  # bytes of a file, in which there are a million results and more
_PAGE = 1024  # bytes
_LEAF = 13  # first byte of a page that holds records; that of a further page of a long one is 0
_ON_DISK_WITHIN = 1.0  # s
_WAIT = 60.0  # s for another process that writes
_COLUMNS = (
    "number INTEGER PRIMARY KEY, kind TEXT, key TEXT, status TEXT, data BLOB, checksum INTEGER"
)
# The second table has a copy of the first record, on a page of its own.
_SCHEMA = [
    ("table", name, name, page, f"CREATE TABLE {name} ({_COLUMNS})")
    for page, name in enumerate(("records", "copies"), 2)
]
_INSERT = "INSERT INTO records VALUES (?, ?, ?, ?, ?, ?)"
# Of the first page: the count of changes twice, and a number that SQLite leaves to its users.
_CHANGES, _DIGEST, _VALID_FOR = slice(24, 28), slice(60, 64), slice(92, 96)


class _Begun(Struct):
    """What a record holds that is no result."""

    meta: dict[str, Any]
    at: float = 0.0


@dataclass(slots=True)
class Record:
    """One record.

    Arguments:
        kind: ``run``, ``result`` or ``end``.
        data: JSON of the result, or of ``meta`` and, where a run begins, the time ``at``.
        file, number: where it stands, from 1.
    """

    kind: str
    key: str
    status: str
    data: bytes
    file: Path = Path()
    number: int = 0

    def result(self) -> JobResult:
        """Return the result; raises InputError naming the first field that is wrong."""
        try:
            return decode_result(self.data)
        except InputError as fault:
            where: Any = {"file": self.file, "line": self.number, "key": fault.key}
            raise InputError(fault.what, **where, expected=fault.expected) from None

    def meta(self) -> dict[str, Any]:
        """Return the meta data; raises as `result` does."""
        return meta_from_json(self._begun().meta, file=self.file, line=self.number)

    @property
    def at(self) -> float:
        """Return when the run began, in seconds since 1970; raises as `result` does."""
        return self._begun().at

    def _begun(self) -> _Begun:
        where: Any = {"file": self.file, "line": self.number}
        found = parse_json(self.data, **where, expected="a table of JSON")
        return read_plain(_Begun, found, **where)


def _row(number: int, record: Record) -> Row:
    parts = number, record.kind, record.key, record.status, record.data
    return *parts, _checksum(*parts)


def _record_of(row: Row, file: Path) -> Record:
    number, kind, key, status, data, _ = row
    return Record(kind, key, status, data, file, number)


def _checksum(number: int, kind: str, key: str, status: str, data: bytes) -> int:
    return zlib.crc32(data, zlib.crc32(f"{number} {kind} {key} {status} ".encode()))


def _is_whole(row: Row) -> bool:
    number, kind, key, status, data, checksum = row
    try:
        return _checksum(number, kind, key, status, data) == checksum
    except (TypeError, UnicodeError):  # what is damaged may be of any type
        return False


def _connect(file: Path) -> sqlite3.Connection:
    """Return a connection to a regular file; every statement is a transaction."""
    check_regular(file, LARGEST)
    # Who may not write there cannot make a log, which a file without one may ask for.
    is_ours = os.access(file.parent, os.W_OK) or file.with_name(f"{file.name}-wal").exists()
    where = f"{file.absolute().as_uri()}?{'mode=rw' if is_ours else 'mode=ro&immutable=1'}"
    return sqlite3.connect(
        where, uri=True, timeout=_WAIT, isolation_level=None, check_same_thread=False
    )


def _check_tables(connection: sqlite3.Connection) -> None:
    """Make sure of the tables of a run and nothing else: a view in their place might never end."""
    if connection.execute("SELECT * FROM sqlite_schema").fetchmany(3) != _SCHEMA:
        raise sqlite3.DatabaseError("its tables are not those of a run")


def make_image(records: Iterable[Record]) -> bytes:
    """Return the content of a file with these records, numbered anew."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as made:
        made.execute(f"PRAGMA page_size = {_PAGE}")
        for *_, sql in _SCHEMA:
            made.execute(sql)
        made.execute("BEGIN")
        made.executemany(_INSERT, (_row(n, record) for n, record in enumerate(records, 1)))
        made.execute("INSERT INTO copies SELECT * FROM records WHERE number = 1")
        made.execute("COMMIT")
        return made.serialize()


def write_file(file: Path, records: Iterable[Record]) -> None:
    """Write a file of records, or in place of one; it is on the disk before that one goes.

    Raises:
        OSError: when it cannot be written.
    """
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(make_image(records))
            stream.flush()
            os.fsync(stream.fileno())
        part.chmod(0o644)
        for end in ("-wal", "-shm"):  # what belongs to the old content
            file.with_name(f"{file.name}{end}").unlink(missing_ok=True)
        part.replace(file)
        if os.name == "nt":  # which opens no folder
            return
        descriptor = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    finally:
        part.unlink(missing_ok=True)


class RecordWriter:
    """Adds records to the file of a run that is there.

    Raises:
        sqlite3.Error: when the file cannot be written, as all methods do.
    """

    def __init__(self, file: Path) -> None:
        self._lock = threading.Lock()
        self._is_due = False
        self._fault: sqlite3.Error | None = None
        self._connection = _connect(file)
        _check_tables(self._connection)
        self._ask("PRAGMA synchronous = NORMAL")
        if self._ask("PRAGMA user_version") != (0,):
            self._ask("PRAGMA user_version = 0")  # the digest of a file that grows no longer holds
        # A torn end of that log is left out when the file is next opened.
        self._ask("PRAGMA journal_mode = WAL")

    def append(self, record: Record, *, at_once: bool = False) -> None:
        """Add a record; it is on the disk within a second, or at once.

        Raises:
            sqlite3.Error: when there is no room, or what was added before is not on the disk.
        """
        with self._lock:
            if self._fault is not None:
                fault, self._fault = self._fault, None
                raise fault
            self._ask(f"PRAGMA synchronous = {'FULL' if at_once else 'NORMAL'}")
            self._ask("BEGIN IMMEDIATE")
            try:
                (last,) = self._ask("SELECT coalesce(max(number), 0) FROM records")
                self._connection.execute(_INSERT, _row(last + 1, record))
                self._ask("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._ask("ROLLBACK")
                raise
            if not at_once:
                self._sync_soon()

    def close(self, *, is_complete: bool = False) -> None:
        """Leave the file alone on the disk, without a log.

        Arguments:
            is_complete: nothing comes after it: a digest of the whole file goes into it.
        """
        # While somebody reads, the log stays, for the next one who writes or reads.
        with self._lock, closing(self._connection), suppress(sqlite3.Error):
            if self._ask("PRAGMA journal_mode = DELETE") == ("delete",) and is_complete:
                digest = _digest_of(self._connection.serialize())
                self._ask(f"PRAGMA user_version = {(digest ^ 1 << 31) - (1 << 31)}")

    def _sync_soon(self) -> None:
        if not self._is_due:
            self._is_due = True
            timer = threading.Timer(_ON_DISK_WITHIN, self._sync)
            timer.daemon = True
            timer.start()

    def _sync(self) -> None:
        with self._lock:
            self._is_due = False
            try:
                _, logged, done = self._ask("PRAGMA wal_checkpoint")
                if done < logged:  # somebody reads what was there before
                    self._sync_soon()
            except sqlite3.ProgrammingError:  # it was closed, which did the same
                pass
            except sqlite3.Error as error:
                self._fault = error

    def _ask(self, statement: str) -> Any:  # noqa: ANN401 - a row has values of any type
        return self._connection.execute(statement).fetchone()


def _digest_of(content: bytes) -> int:
    """Return a checksum of a whole file, not 0, but for what to write it down changes."""
    digest, place = 0, 0
    for part in (_CHANGES, _DIGEST, _VALID_FOR):
        digest, place = zlib.crc32(content[place : part.start], digest), part.stop
    return zlib.crc32(content[place:], digest) or 1


def read_records(file: Path, faults: list[InputError]) -> Iterator[Record]:
    """Yield the records of a file in their order; what is damaged is left out.

    Arguments:
        faults: takes an error for every record that is lost, or one for other damage.

    Raises:
        InputError: when the file cannot be read.
    """
    number, kind = 0, ""
    try:
        with closing(_connect(file)) as connection:
            _check_tables(connection)
            for row in connection.execute("SELECT * FROM records ORDER BY number"):
                if row[0] != number + 1 or not _is_whole(row):
                    raise sqlite3.DatabaseError(f"record {number + 1} is not as it was written")
                number, kind = number + 1, row[1]
                yield _record_of(row, file)
            # A damaged tree may look as if it ended early.
            if kind != "end" and (wrong := _check_tree(connection)):
                raise sqlite3.DatabaseError(wrong)
        return
    except _DAMAGE as error:
        why = error
    rest = {n: record for n, record in _salvage(file).items() if n > number}
    expected = "the record that was written"
    lost = [n for n in range(number + 1, max(rest, default=number)) if n not in rest]
    faults.extend(InputError("damaged", file=file, line=n, expected=expected) for n in lost)
    if not lost:
        is_shut = getattr(why, "sqlite_errorcode", None) == sqlite3.SQLITE_CANTOPEN
        what = f"{'cannot be read' if is_shut else 'damaged'}: {why}"
        faults.append(InputError(what, file=file, expected="what was written"))
    yield from (rest[n] for n in sorted(rest))


def _salvage(file: Path) -> dict[int, Record]:
    """Return all records that are whole anywhere in a damaged file or in its log, by number."""
    contents = [read_bytes(file, LARGEST)]
    with suppress(*_DAMAGE), closing(_connect(file)) as connection:
        contents.append(connection.serialize())  # with what is in the log alone
    return {
        row[0]: _record_of(row, file)
        for content in contents
        for row in _rows_of(bytearray(content))
    }


def _rows_of(content: bytearray) -> Iterator[Row]:
    """Yield all records that are whole in the content of a damaged file.

    Every page is read as if it were a table of its own, so that neither the first page nor those
    that lead to others have to be whole.
    """
    content += bytes(-len(content) % _PAGE)  # of a file that was cut short
    pages = len(content) // _PAGE
    content[:_PAGE] = make_image(())[:_PAGE]
    content[28:32] = pages.to_bytes(4, "big")
    starts = [start for start in range(_PAGE, len(content), _PAGE) if content[start]]
    for start in starts:
        content[start] = _LEAF
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        connection.deserialize(bytes(content))

        def rows(question: str) -> list[Row]:
            with suppress(*_DAMAGE):
                return connection.execute(question).fetchall()
            return []

        for start in starts:
            connection.execute("PRAGMA writable_schema = ON")
            root = f"UPDATE sqlite_schema SET rootpage = {start // _PAGE + 1}"
            connection.execute(f"{root} WHERE name = 'records'")
            connection.execute("PRAGMA writable_schema = RESET")
            for number, *_ in rows("SELECT number FROM records"):
                found = rows(f"SELECT * FROM records WHERE number = {number}")
                yield from filter(_is_whole, found)


def _check_tree(connection: sqlite3.Connection) -> str:
    """Return what is wrong with the pages of a file; nothing where they are in order."""
    (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    return "" if found == "ok" else str(found)


def read_contents(
    file: Path, faults: list[InputError]
) -> Iterator[tuple[Record, JobResult | dict[str, Any]]]:
    """Yield the records of a file with the result or the meta data that they hold.

    Arguments and errors are those of `read_records`; what cannot be decoded is left out too.
    """
    for record in read_records(file, faults):
        try:
            yield record, record.result() if record.kind == "result" else record.meta()
        except InputError as fault:
            faults.append(fault)


def find_faults(file: Path) -> list[InputError]:
    """Return what is damaged or missing in a file; every record is read to its end.

    Of a file that is complete, every bit is checked; of another, those of records and of what
    leads to them.
    """
    faults: list[InputError] = []
    try:
        for _ in read_contents(file, faults):
            pass
    except InputError as fault:
        return [fault]
    if not faults:
        with suppress(*_DAMAGE), closing(_connect(file)) as connection:
            if wrong := _check_tree(connection):
                faults.append(InputError(f"damaged: {wrong}", file=file))
    if not faults:
        content = read_bytes(file, LARGEST)
        digest = int.from_bytes(content[_DIGEST], "big")
        if content[_CHANGES] != content[_VALID_FOR] or digest not in (0, _digest_of(content)):
            faults.append(InputError("damaged where no record is", file=file))
    return sorted(faults, key=lambda fault: fault.line or 0)

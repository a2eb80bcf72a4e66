"""Objects in stores and on web servers, as paths whose bytes are read by ranges.

obstore speaks to the stores, retries requests that fail, and finds credentials where their own tools put them in the
environment (AWS_ACCESS_KEY_ID, GOOGLE_APPLICATION_CREDENTIALS, AZURE_STORAGE_ACCOUNT_KEY and the like). Neither they
nor the query of a signed link are ever part of a message.
"""

import os
import re
import stat
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import Any, Final, Self, TypeVar

from navirl_cli.errors import LogError, MissingPackageError

#: How an address begins, and a path that was made of it: paths join slashes.
_SCHEME: Final = re.compile(r"(s3|gs|az|https?):/+")
#: A connection that breaks within the body of an answer is tried again so often, after these times, s.
_RETRIES_S: Final = (0.2, 0.8, 3.0)
#: Further attempts of obstore for each request, and the time for all of them, s.
_ATTEMPTS, _ATTEMPTS_S = 5, 60
_TIMEOUT_S: Final = 60
#: By scheme, the variables of credentials, and what makes requests to a public bucket go without.
_CREDENTIALS: Final = {
    "s3": ("AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY", "AWS_SKIP_SIGNATURE=true"),
    "gs": ("GOOGLE_APPLICATION_CREDENTIALS, the file of an account", "GOOGLE_SKIP_SIGNATURE=true"),
    "az": (
        "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY",
        "AZURE_STORAGE_ACCOUNT_NAME and AZURE_SKIP_SIGNATURE=true",
    ),
}
#: How obstore's errors say that there are no credentials (they ask the machine's own, in a cloud), and that they are
#: not valid.
_NONE_FOUND: Final = ("169.254.169.254", "metadata.google", "CredentialsNotLoaded", "Account must be specified")
_NOT_VALID: Final = ("service account file", "Invalid Access Key", "DecodeCredentials", "OpenCredentials", "InvalidKey")

T = TypeVar("T")


@dataclass
class Fetched:
    """What was read of an object."""

    size: int
    etag: str
    #: Bytes and requests so far, and the hash of each range that was read.
    size_read: int = 0
    requests: int = 0
    hashes: dict[tuple[int, int], str] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def add(self, start: int, data: bytes) -> None:
        """Count a range that was read, in any thread."""
        with self._lock:
            self.size_read += len(data)
            self.hashes[start, start + len(data)] = sha256(data).hexdigest()

    def ask(self) -> None:
        """Count a request, in any thread."""
        with self._lock:
            self.requests += 1

    @property
    def sha256(self) -> str:
        """Of size and all ranges that were read: it proves what results come from, not the rest of the object."""
        lines = [f"{start} {stop} {own}" for (start, stop), own in sorted(self.hashes.items())]
        return sha256("\n".join([str(self.size), *lines]).encode()).hexdigest()


class Remote(type(Path())):  # type: ignore[misc]
    """An address as a path: it joins, sorts and prints as one, and asks the store for what it is."""

    @property
    def address(self) -> str:
        """The address, with its query."""
        return _SCHEME.sub(lambda match: f"{match[1]}://", super().__str__(), count=1)

    def __str__(self) -> str:
        return self.address.partition("?")[0]

    def __fspath__(self) -> str:
        return str(self)

    @property
    def name(self) -> str:
        """The last part of the key."""
        return PurePosixPath(str(self)).name

    @property
    def fetched(self) -> Fetched:
        """Size and etag, from the first call on, and what was read since.

        Raises:
            FileNotFoundError: The store has no such object.
            LogError: It cannot be asked.
        """
        if "_fetched" not in self.__dict__:
            meta = _asked(self, lambda: _obstore().head(*_place(self.address)))
            self.__dict__["_fetched"] = Fetched(int(meta["size"]), _etag(meta), requests=1)
        found: Fetched = self.__dict__["_fetched"]
        return found

    @property
    def is_listing(self) -> bool:
        """Whether it stands for all objects below it."""
        return bool(self.__dict__.get("_listing"))

    def listing(self) -> Self:
        """The same address, for all objects below it."""
        self.__dict__["_listing"] = True
        return self

    def stat(self, *, follow_symlinks: bool = True) -> os.stat_result:  # noqa: ARG002
        """Size and kind; numbers of device and file follow from the address."""
        number = int(sha256(self.address.encode()).hexdigest()[:15], 16)
        if self.is_listing:
            return os.stat_result((stat.S_IFDIR, number, -1, 1, 0, 0, 0, 0, 0, 0))
        return os.stat_result((stat.S_IFREG, number, -1, 1, 0, 0, self.fetched.size, 0, 0, 0))

    def absolute(self) -> Self:
        """It is."""
        return self

    def resolve(self, strict: bool = False) -> Self:  # noqa: ARG002
        """It is."""
        return self

    def is_file(self) -> bool:
        """Whether it is an object."""
        return not self.is_listing

    def is_dir(self) -> bool:
        """Whether it stands for several."""
        return self.is_listing

    def iterdir(self) -> Iterator["Remote"]:
        """Objects and prefixes directly below it."""
        store, prefix = _place(self.address.rstrip("/") + "/")
        found = _asked(self, lambda: _obstore().list_with_delimiter(store, prefix or None))
        root = self.address.rstrip("/").removesuffix(prefix.rstrip("/")).rstrip("/")
        for one in found["common_prefixes"]:
            yield Remote(f"{root}/{one}").listing()
        for meta in found["objects"]:
            if meta["path"].rstrip("/") != prefix.rstrip("/"):
                yield Remote(f"{root}/{meta['path']}")

    def fetch(self, start: int, stop: int) -> bytes:
        """Bytes [start, stop).

        Raises:
            LogError: The object has changed since it was first asked for, or cannot be read.
        """
        known = self.fetched
        if stop <= start:
            return b""
        store, key = _place(self.address)

        def get() -> bytes:
            known.ask()
            answer = _obstore().get(store, key, options={"range": (start, stop)})
            if (found := _etag(answer.meta)) != known.etag or int(answer.meta["size"]) != known.size:
                raise LogError(
                    f"{self}: expected the object with etag {known.etag} during the whole reading, found {found}; "
                    "it was replaced meanwhile: run the command again"
                )
            return bytes(answer.bytes())

        data = _asked(self, get)
        if len(data) != stop - start:
            raise LogError(f"{self}: expected {stop - start} bytes from byte {start}, found {len(data)}")
        known.add(start, data)
        return data


def path_of(text: str | os.PathLike[str]) -> Path:
    """The path of an argument: a local one, or of an address in a store. One that ends in / stands for all below it."""
    if isinstance(text, Remote):
        return text
    plain = os.fspath(text)
    if plain.startswith("file://"):
        return Path(plain.removeprefix("file://"))
    if not isinstance(text, str) or not _SCHEME.match(plain):
        return Path(text)
    return Remote(plain).listing() if plain.endswith("/") else Remote(plain)


def _etag(meta: Any) -> str:
    """What changes with an object: its etag, or the time of its last change."""
    return str(meta.get("e_tag") or meta.get("last_modified"))


def _place(address: str) -> tuple[Any, str]:
    """The store of an address and the key in it."""
    scheme, _, rest = address.partition("://")
    host, _, key = rest.partition("/")
    if scheme in {"http", "https"}:
        key, _, query = key.partition("?")
        return _store(f"{scheme}://{host}", f"{key}?{query}" if query else key), "" if query else key
    return _store(f"{scheme}://{host}", ""), key


@cache
def _store(root: str, whole: str) -> Any:
    """A store; a signed link is one by itself, because its query belongs to every request."""
    from obstore.store import from_url

    retry: Any = {"max_retries": _ATTEMPTS, "retry_timeout": timedelta(seconds=_ATTEMPTS_S)}
    client: Any = {"timeout": timedelta(seconds=_TIMEOUT_S), "allow_http": _allows_http(root)}
    url = f"{root}/{whole}" if "?" in whole else root
    return from_url(url, retry_config=retry, client_options=client)


def _allows_http(root: str) -> bool:
    """Whether connections may be without encryption: where the user wrote an address of that kind."""
    return root.startswith("http://") or os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://")


def _obstore() -> Any:
    try:
        import obstore
    except ImportError as error:
        raise MissingPackageError(
            "addresses of stores: expected the package obstore, found that it is not installed; "
            "install it: pip install 'navirl[remote]'"
        ) from error
    return obstore


def _asked(path: Remote, ask: Callable[[], T]) -> T:
    """The answer of a store; what breaks within an answer is tried again."""
    _obstore()
    for wait_s in (*_RETRIES_S, None):
        try:
            return ask()
        except LogError:
            raise
        except Exception as error:  # noqa: BLE001 - obstore's errors have no common type but this
            if wait_s is None or not _may_pass(error):
                raise _refused(path, error) from None  # the cause may hold what must not be shown
            time.sleep(wait_s)
    raise AssertionError


def _may_pass(error: Exception) -> bool:
    """Whether a fault may be gone at the next attempt: a broken body, which obstore does not ask for again."""
    return type(error).__name__ in {"GenericError", "BaseError"} and "body" in str(error).lower()


def _refused(path: Remote, error: Exception) -> Exception:
    """What a store's error means, without what it was asked with."""
    kind, text = type(error).__name__, str(error)
    bucket = f"{path.address.partition('://')[2].partition('/')[0]}"
    if "NoSuchBucket" in text or "ContainerNotFound" in text:
        return LogError(
            f"{path}: expected a bucket {bucket}, found none of that name; check it, and region and endpoint"
        )
    if kind in {"NotFoundError", "FileNotFoundError"} or isinstance(error, FileNotFoundError):
        return FileNotFoundError(2, "the store has no such object", str(path))
    names, public = _CREDENTIALS.get(path.address.partition("://")[0], ("", ""))
    if names and any(part in text for part in _NONE_FOUND):
        return LogError(
            f"{path}: expected credentials in the environment (such as {names}), found none; set them, or {public} for "
            "a public bucket"
        )
    if names and any(part in text for part in _NOT_VALID):
        return LogError(f"{path}: expected valid credentials in {names}, found others; correct them")
    if kind in {"PermissionDeniedError", "UnauthenticatedError"} or re.search(r"\b40[13]\b", text):
        what = "the link may have expired" if "?" in path.address else "check the credentials in the environment"
        return LogError(f"{path}: expected the right to read it, found that the store refuses; {what}")
    code = re.search(r"\b[45][0-9]{2} [A-Z][A-Za-z ]{2,30}", text)
    found = code[0].strip() if code else "no usable answer"
    return LogError(f"{path}: expected the store to answer, found: {found} after several attempts; try again later")

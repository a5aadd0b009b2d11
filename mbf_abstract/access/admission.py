"""Who is let in to a WebSocket server, and the pages that it answers with over HTTP."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

from mbf_abstract.access.page_access import PageAccess

MOST_REFUSALS = 20  # that are reported
PRIVATE_HEADERS = {
    "Referrer-Policy": "no-referrer",  # the token is in the address
    "Cache-Control": "no-store",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
}
"""Of every page that is served."""
SECURITY_HEADERS = {
    **PRIVATE_HEADERS,
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
    "connect-src 'self' ws: wss:",
}


@dataclass
class Admission:
    """Answers the requests for one server.

    Attributes
    ----------
    access, origins, pages, origin_option, takes_auth
        As of ``ServerOptions`` and ``Offer``.
    report : callable
        Called with the reason of a refusal; once for each reason, and at most ``MOST_REFUSALS`` times.
    """

    access: PageAccess
    origins: tuple[str, ...]
    pages: Mapping[str, tuple[str, bytes]]
    origin_option: str
    takes_auth: bool
    report: Callable[[str], None]
    _refused: set[str] = field(default_factory=set, init=False)

    def answer(self, connection: Any, request: Any) -> Any:
        """Refuse a request, answer it with a page, or let the WebSocket begin (None)."""
        reason = self._refusal(request.path, request.headers)
        if reason:
            if reason not in self._refused and len(self._refused) < MOST_REFUSALS:
                self._refused.add(reason)
                self.report(reason)
            return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        found = self.access.role_and_path(request.path)
        if found is None:
            return connection.respond(HTTPStatus.FORBIDDEN, "the address needs the token\n")
        page = self.pages.get(found[1])
        if page is None:
            return connection.respond(HTTPStatus.NOT_FOUND, "there is no such page\n")
        response = connection.respond(HTTPStatus.OK, "")
        response.body = page[1]
        del response.headers["Content-Type"], response.headers["Content-Length"]
        response.headers.update({**SECURITY_HEADERS, "Content-Type": page[0], "Content-Length": str(len(page[1]))})
        return response

    def _refusal(self, path: str, headers: Any) -> str:
        """Why a request is refused, empty if it is not; programs that are no browser send no ``Origin``."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or not self.access.knows_host(hosts[0]):
            return "this is not the name of the machine that serves"
        own = origins and self.access.is_same_site(origins[0], hosts[0])
        if len(origins) > 1 or (origins and not own and origins[0] not in self.origins):
            return f"a page of {origins[0]} may not connect; see {self.origin_option}"
        if self.access.role_and_path(path) is None:
            if path not in ("", "/"):
                return "the token in the address is wrong"
            if not self.takes_auth:
                return "the address needs the token"
        return ""

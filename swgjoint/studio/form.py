"""Form of a design: one field for each key of the schema, faults beside their field."""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui

from swgjoint.studio.draft import Draft
from swgjoint.studio.fields import Field, list_fields, text_of, value_at
from swgjoint.studio.session import Session

OPEN = ("flexspline", "wave_generator")
"""Tables that are open at first."""
WAIT_MS = 400
"""Time without typing after which an input is read [ms]."""


class Form:
    """Fields of the current draft.

    Args:
        session: State of the tab.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._box = ui.column().classes("w-full gap-1")
        self._faults: dict[str, ui.label] = {}
        self._groups: dict[str, Any] = {}
        self._own: Draft | None = None
        self._keys: list[str] = []

    def update(self, beside: dict[str, str]) -> None:
        """Show the current draft and the messages beside its fields.

        The fields are built anew only if others are needed, or if the draft did not
        come from them.

        Args:
            beside: Messages by key.
        """
        draft = self._session.current.draft
        keys = [field.key for field in list_fields(draft)]
        if draft is not self._own or keys != self._keys:
            self._own, self._keys = draft, keys
            self._build()
        for key, label in self._faults.items():
            label.text = beside.get(key, "")
            label.visible = key in beside
        for table, group in self._groups.items():
            wrong = any(key == table or key.startswith(f"{table}.") for key in beside)
            group.classes(**{"add" if wrong else "remove": "faulty"})

    def _build(self) -> None:
        opened = {k for k, g in self._groups.items() if g.value} or set(OPEN)
        self._box.clear()
        self._faults, self._groups = {}, {}
        group: Any = None
        for field in list_fields(self._session.current.draft):
            if field.table and not field.above:
                with self._box:
                    group = ui.expansion(field.label, value=field.key in opened)
                group.classes("w-full").props(f"dense data-key={field.key}")
                group.props('header-class="bg-grey-2 text-weight-medium"')
                self._groups[field.key] = group
            with group:
                if field.table:
                    self._table(field)
                else:
                    self._value(field)
                self._faults[field.key] = (
                    ui.label().classes("fault").props(f"data-fault={field.key}")
                )

    def _table(self, field: Field) -> None:
        """Heading of a nested table, and the switch of one that may be absent."""
        there = value_at(self._session.current.draft, field.key) is not None
        if field.removable:
            ui.switch(
                field.label,
                value=there,
                on_change=lambda e: self._session.edit(
                    field.key, {} if e.value else None
                ),
            ).props("dense").tooltip(field.meaning)
        elif field.above:
            ui.label(field.label).classes("text-caption text-weight-medium").tooltip(
                field.meaning
            )

    def _value(self, field: Field) -> None:
        text = text_of(value_at(self._session.current.draft, field.key))
        with ui.row().classes("w-full no-wrap items-center gap-2"):
            ui.label(field.label).classes("field-label").style("flex:1").tooltip(
                field.hint
            )
            if field.choices:
                value = text or field.default or None
                options = dict.fromkeys((*field.choices, *filter(None, [value])))
                entry: Any = ui.select(
                    {one: one.replace("_", " ") for one in options}, value=value
                )
            else:
                entry = ui.input(value=text, placeholder=field.default)
                entry.props(f'debounce={WAIT_MS} input-class="text-right"')
                if field.unit:
                    entry.props(f'suffix="{field.unit}"')
            entry.on_value_change(partial(self._changed, field))
            entry.props(f"dense outlined hide-bottom-space data-key={field.key}")
            entry.style("width:170px; flex:none").classes("value")

    def _changed(self, field: Field, event: Any) -> None:
        same = self._own is self._session.current.draft
        self._session.edit_text(field, str(event.value or ""))
        if same:  # the fields already show this draft
            self._own = self._session.current.draft

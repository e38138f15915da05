/** Events around the moment: filtered by kind, searched by word. */

import { lastAtMost } from "../data/search";
import * as state from "../state";

const BEFORE = 40;
const AFTER = 60;

export function EventsPanel() {
  const run = state.run.value!;
  const rows = state.foundEvents.value;
  const us = state.told.value;
  const at = lastAtMost(state.foundTimes.value, us) + 1;
  const visibleRows = rows.slice(Math.max(0, at - BEFORE), at + AFTER);
  return (
    <div>
      <div class="row">
        <KindChoice />
        <input
          id="search"
          type="search"
          placeholder="Search events"
          aria-label="Search events"
          value={state.search.value}
          onInput={(event) => {
            state.search.value = event.currentTarget.value;
          }}
        />
      </div>
      <p class="hint" data-count={rows.length}>
        {rows.length} event{rows.length === 1 ? "" : "s"}
        {state.search.value || state.eventKind.value ? ` of ${run.events.rows.length}` : ""}
      </p>
      <ol class="events">
        {visibleRows.map((row) => (
          <li key={row.index} class={row.us > us ? "later" : ""}>
            <button type="button" class="link" onClick={() => state.goTo(row.us)}>
              <time>{run.clock.text(row.us)}</time> <b>{row.entity}</b> {row.event.replaceAll("_", " ")} {row.user} {row.detail}
            </button>
          </li>
        ))}
      </ol>
    </div>
  );
}

export function KindChoice() {
  const run = state.run.value!;
  void run.version.value;
  return (
    <select
      aria-label="Kind of event"
      value={state.eventKind.value}
      onChange={(event) => {
        state.eventKind.value = event.currentTarget.value;
      }}
    >
      <option value="">all events</option>
      {run.events.kinds.map((kind) => (
        <option key={kind} value={kind}>
          {kind.replaceAll("_", " ")}
        </option>
      ))}
    </select>
  );
}

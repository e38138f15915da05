/** Notes and bookmarks of the first run, which the server stores beside it. */

import { useRef } from "preact/hooks";
import * as state from "../state";

export function NotesPanel() {
  const run = state.run.value!;
  const input = useRef<HTMLInputElement>(null);
  const notes = run.notes.value;
  const add = (): void => {
    const note = { step: run.clock.stepAt(state.moment.value), text: input.current!.value.trim() };
    void run.storeNotes([...notes, note]);
    input.current!.value = "";
    input.current!.blur();
  };
  if (!run.path.startsWith("run/")) return <p class="hint">Notes are stored beside a run: open one that is over with fleet2d view.</p>;
  return (
    <div>
      <div class="row">
        <input
          id="note"
          ref={input}
          maxLength={2000}
          aria-label="Note at this moment; empty: a bookmark"
          placeholder="note at this moment"
          onKeyDown={(event) => {
            if (event.key === "Enter") add();
          }}
        />
        <button type="button" onClick={add}>
          Add
        </button>
      </div>
      <ol class="events notes-list" data-count={notes.length}>
        {notes.map((note, i) => (
          <li key={`${note.step} ${i}`} class="row">
            <button type="button" class="link" onClick={() => state.goTo(note.step * run.clock.stepUs)}>
              <time>{run.clock.text(note.step * run.clock.stepUs)}</time> {note.text || "bookmark"}
            </button>
            <button type="button" aria-label={`Remove ${note.text || "bookmark"}`} onClick={() => void run.storeNotes(notes.filter((_, k) => k !== i))}>
              ×
            </button>
          </li>
        ))}
      </ol>
      <p class="hint">Stored beside the run, as {run.facts.title}.notes.json: it is no part of the run or its seal.</p>
    </div>
  );
}

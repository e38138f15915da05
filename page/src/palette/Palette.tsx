/** One field to ask, to go somewhere and to do anything; the answers are listed below it, with the home at each. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { completions } from "../data/ask";
import type { Run } from "../data/run";
import { Icon } from "../Icon";
import * as state from "../state";
import { Thumbnail } from "../timeline/Hover";
import { answerItems, type Item, itemsOf } from "./items";

/** Items are looked for when nobody typed for so long [ms]. */
const SETTLES_MS = 110;

export function Palette() {
  const run = state.run.value!;
  const text = useSignal(state.question.value?.text ?? "");
  const settled = useSignal(text.value);
  const isOpen = useSignal(false);
  const active = useSignal(0);
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  const box = useRef<HTMLDivElement>(null);
  void run.version.value;
  const answer = state.answer.value;
  // Read by tests and by nobody else: the first stretches in steps.
  const steps = answer?.spans.slice(0, 1000).map(({ from, to }) => `${from / run.clock.stepUs}-${to / run.clock.stepUs}`);
  const put = (question: string): void => {
    text.value = question;
    settled.value = question;
    active.value = 0;
    state.question.value = question.trim() ? { text: question, nearUs: state.moment.value } : null;
    const first = state.answer.value?.spans[0];
    if (first) state.goTo(first.from);
  };
  const items = isOpen.value ? shownItems(run, settled.value, put) : [];
  const choose = (item: Item | undefined): void => {
    if (!item) return;
    item.run();
    if (item.stays) return;
    text.value = state.question.value?.text ?? "";
    settled.value = text.value;
    isOpen.value = false;
    document.getElementById("ask")?.blur();
  };
  const type = (words: string): void => {
    text.value = words;
    active.value = 0;
    isOpen.value = true;
    if (!words) put("");
    clearTimeout(timer.current);
    timer.current = setTimeout(() => (settled.value = words), SETTLES_MS);
  };
  const press = (event: KeyboardEvent): void => {
    const by = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (by && items.length > 0) {
      active.value = (active.value + by + items.length) % items.length;
      document.getElementById(`item-${active.value}`)?.scrollIntoView({ block: "nearest" });
      event.preventDefault();
    }
    if (event.key === "Escape") isOpen.value = false;
    if (event.key !== "Enter") return;
    const isMoved = active.value > 0 && settled.value === text.value;
    settled.value = text.value;
    isOpen.value = true;
    const isAsked = state.question.value?.text === text.value;
    choose(isMoved ? items[active.value] : isAsked ? items[0] : itemsOf(run, text.value, put)[0]);
  };
  return (
    <div
      ref={box}
      class="ask"
      onFocusOut={(event) => {
        if (!box.current!.contains(event.relatedTarget as Node | null)) isOpen.value = false;
      }}
    >
      <Icon name="search" />
      <input
        id="ask"
        type="text"
        role="combobox"
        aria-label="Ask, go to, or do something"
        aria-describedby="ask-answer"
        aria-expanded={isOpen.value}
        aria-controls="palette"
        aria-activedescendant={isOpen.value && items.length > 0 ? `item-${active.value}` : undefined}
        autocomplete="off"
        placeholder="Ask or go to …"
        size={24}
        value={text.value}
        onFocus={() => (isOpen.value = true)}
        onInput={(event) => type(event.currentTarget.value)}
        onKeyDown={press}
      />
      <kbd aria-hidden="true">Ctrl K</kbd>
      <output id="ask-answer" data-question={answer?.question} data-spans={steps?.join(" ")} data-count={answer?.spans.length ?? 0}>
        {answer?.words ?? ""}
      </output>
      {isOpen.value && (
        <div class="palette">
          {answer && answer.question === settled.value && <p class="answer">{answer.words}</p>}
          <Completions run={run} text={text.value} put={type} />
          <ul id="palette" role="listbox" aria-label="Questions, places and actions">
            {items.map((item, i) => (
              <Row key={item.key} run={run} item={item} index={i} isFirst={item.group !== items[i - 1]?.group} isActive={i === active.value} choose={choose} />
            ))}
          </ul>
          <More run={run} shown={items.filter(({ group }) => group === "Answers").length} />
        </div>
      )}
    </div>
  );
}

/** The answers to what was asked; else what the text may mean. */
function shownItems(run: Run, text: string, put: (text: string) => void): Item[] {
  const answer = state.answer.value;
  if (answer && answer.question === text && answer.spans.length > 0) return answerItems(run, answer);
  return itemsOf(run, text, put);
}

interface RowProps {
  run: Run;
  item: Item;
  index: number;
  isFirst: boolean;
  isActive: boolean;
  choose: (item: Item) => void;
}

function Row({ run, item, index, isFirst, isActive, choose }: RowProps) {
  return (
    <li
      id={`item-${index}`}
      role="option"
      aria-selected={isActive}
      data-group={isFirst ? item.group : undefined}
      onPointerDown={(event) => event.preventDefault()}
      onClick={() => choose(item)}
    >
      {item.us !== null && <Thumbnail run={run} us={item.us} focus={item.focus} />}
      <span>
        <b>{item.title}</b>
        {item.hint && <small>{item.hint}</small>}
      </span>
    </li>
  );
}

/** Words that can follow. */
function Completions({ run, text, put }: { run: Run; text: string; put: (text: string) => void }) {
  const words = useSignal<readonly string[]>([]);
  useEffect(() => {
    words.value = text.trim() && state.question.value?.text !== text ? completions(run, text, state.runs.value.length > 1).slice(0, 7) : [];
  }, [text]);
  if (words.value.length === 0) return null;
  return (
    <p class="completions">
      {words.value.map((whole) => (
        <button key={whole} type="button" tabIndex={-1} onPointerDown={(event) => event.preventDefault()} onClick={() => put(`${whole} `)}>
          {whole.slice(text.lastIndexOf(" ") + 1)}
        </button>
      ))}
    </p>
  );
}

function More({ run, shown }: { run: Run; shown: number }) {
  const count = state.answer.value?.spans.length ?? 0;
  if (shown === 0 || count <= shown) return null;
  return (
    <p class="hint">
      {count - shown} more in {run.facts.title}: n and p step through all of them, and the calendar frames them.
    </p>
  );
}

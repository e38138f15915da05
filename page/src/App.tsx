/** The page: controls, plan, panels, timeline. */

import { useSignal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useRef } from "preact/hooks";
import { showDay } from "./actions";
import { copyLink } from "./address";
import type { VerdictFacts } from "./contract";
import { DAY_US } from "./data/clock";
import type { Run } from "./data/run";
import { title } from "./data/words";
import { KEYS } from "./keyboard";
import { connected } from "./live/feed";
import { Icon } from "./Icon";
import { BeliefsPanel } from "./panels/BeliefsPanel";
import { EventsPanel, KindChoice } from "./panels/EventsPanel";
import { Inspect } from "./panels/Inspect";
import { LayersPanel } from "./panels/LayersPanel";
import { MetricsPanel } from "./panels/MetricsPanel";
import { NotesPanel } from "./panels/NotesPanel";
import { Now } from "./panels/Now";
import { Terms } from "./panels/Terms";
import { downloadFilm, filming } from "./film";
import { Palette } from "./palette/Palette";
import { Plan } from "./plan/Plan";
import { reel } from "./player";
import { recording, saveClip, savePicture, stopClip } from "./share";
import * as state from "./state";
import { dark } from "./theme";
import { Calendar, CalendarHead } from "./timeline/Calendar";
import { Timeline } from "./timeline/Timeline";
import { Clock, Transport } from "./Transport";

const PANELS: Record<state.Panel, [string, ComponentType]> = {
  now: ["Now", Now],
  inspect: ["Inspect", Inspect],
  beliefs: ["Beliefs", BeliefsPanel],
  events: ["Events", EventsPanel],
  metrics: ["Metrics", MetricsPanel],
  layers: ["Layers", LayersPanel],
  notes: ["Notes", NotesPanel],
};

export function App() {
  const runs = state.runs.value;
  const two = runs.length > 1;
  return (
    <div class={two ? "app two" : "app"}>
      <Header />
      <Notes />
      <main>
        <div class="plans">
          <Clock />
          <Reel />
          {runs.map((run, i) => (
            <Plan key={run.path || i} run={run} other={two ? (runs[i === 0 ? 1 : 0] ?? null) : null} title={two ? run.facts.title : ""} />
          ))}
        </div>
        <Panels />
      </main>
      <Transport />
      <Tools />
      {state.view.value === "calendar" ? <Calendar /> : <Timeline />}
    </div>
  );
}

function Header() {
  const run = state.run.value!;
  const { facts } = run;
  const days = (facts.steps * facts.step_us) / DAY_US;
  const length = days >= 2 ? `${Math.round(days)} days` : `${(days * 24).toFixed(1)} h`;
  return (
    <header>
      <span class="brand" title={`Fleet2D ${facts.version}`}>
        <Icon name="robot" />
      </span>
      <h1>{state.runs.value.map((entry) => entry.facts.title).join(" · ")}</h1>
      <p>
        {[length, title(facts.home.name.slice(0, 24)), `seed ${facts.seed ?? "–"}`, facts.digest?.slice(0, 8)].filter(Boolean).join(" · ")}
        {!["complete", "failed"].includes(facts.status) && !state.live.value ? <strong> {facts.status}</strong> : ""}
      </p>
      {state.runs.value.map((entry, i) => (
        <Verdicts key={i} run={entry} title={state.runs.value.length > 1 ? `${entry.facts.title}: ` : ""} />
      ))}
      <span class="spacer" />
      <Palette />
      <Share />
      {run.path && <CopyLink />}
      <button
        type="button"
        class="round"
        aria-label={dark.value ? "Light" : "Dark"}
        onClick={() => {
          state.theme.value = dark.value ? "light" : "dark";
        }}
      >
        <Icon name="theme" />
      </button>
      <Help />
    </header>
  );
}

/** How the timeline shows the run, and which part of it. */
function Tools() {
  const { view } = state;
  return (
    <section class="tools" aria-label="Timeline settings">
      <div class="segments" role="group" aria-label="View of the timeline">
        {(["calendar", "lanes"] as const).map((name) => (
          <button key={name} type="button" aria-pressed={view.value === name} onClick={() => (view.value = name)}>
            {name === "calendar" ? "Calendar" : "Lanes"}
          </button>
        ))}
      </div>
      {view.value === "calendar" && <CalendarHead />}
      <GoTo />
      <KindChoice />
      {view.value === "lanes" && (
        <span class="group">
          <button type="button" aria-label="Zoom in" onClick={() => state.zoom(0.5)}>
            +
          </button>
          <button type="button" aria-label="Zoom out" onClick={() => state.zoom(2)}>
            −
          </button>
          <button type="button" onClick={() => state.showRange(state.beginUs.value, state.endUs.value)}>
            Whole run
          </button>
          <button type="button" onClick={showDay}>
            Day
          </button>
        </span>
      )}
    </section>
  );
}

/** What became of the run and its expectations: failures and violations are red, and the first thing to see. */
function Verdicts({ run, title }: { run: Run; title: string }) {
  const { verdict, verdicts, status } = run.facts;
  // Beside another run there is room for the numbers only.
  const words = title && verdicts.length > 0 ? countsOf(verdicts) : verdict;
  const first = verdicts[0]?.step ?? null;
  if (status !== "failed" && first === null) return words ? <p class="verdict">{title + words}</p> : null;
  const us = (first ?? 0) * run.clock.stepUs;
  const isShown = first !== null && us >= run.beginUs && us < run.endUs;
  const says = verdicts.filter((verdict) => verdict.step !== null).map((verdict) => verdict.says);
  return (
    <button type="button" class="verdict violated" disabled={!isShown} title={says.join("\n")} onClick={() => state.goTo(us)}>
      ✗ {title}
      {[status === "failed" ? "the run failed" : "", words].filter(Boolean).join("; ")}
    </button>
  );
}

/** How many expectations are violated, held, or neither. */
function countsOf(verdicts: readonly VerdictFacts[]): string {
  const outcomes = [...new Set(verdicts.map(({ outcome }) => outcome))];
  return outcomes.map((outcome) => `${verdicts.filter((verdict) => verdict.outcome === outcome).length} ${outcome}`).join(", ");
}

const CONNECTION_LOST = "The connection to the simulation is lost, and tried again: if that lasts, start fleet2d run --live again, and reload the page.";

/** Notes are remarks; what could not be read is missing on the page. */
function Notes() {
  const notes = state.runs.value.flatMap((run) => run.facts.notes);
  const problems = state.runs.value.flatMap((run) => run.problems.value);
  if (state.live.value && !connected.value) problems.push(CONNECTION_LOST);
  if (notes.length + problems.length === 0) return null;
  return (
    <div class="notes">
      {problems.map((problem) => (
        <p key={problem} role="alert" class="status">
          ✗ {problem}
        </p>
      ))}
      {notes.length > 0 && (
        <details>
          <summary>{notes.length === 1 ? "1 note" : `${notes.length} notes`}</summary>
          <ul role="status">
            {notes.map((note) => (
              <li key={note}>{note}</li>
            ))}
          </ul>
        </details>
      )}
    </div>
  );
}

function Panels() {
  const active = state.panel.value;
  const Content = PANELS[active][1];
  const move = (event: KeyboardEvent): void => {
    const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (!by) return;
    const at = (state.PANELS.indexOf(active) + by + state.PANELS.length) % state.PANELS.length;
    state.panel.value = state.PANELS[at]!;
    document.getElementById(`tab-${state.PANELS[at]}`)?.focus();
  };
  return (
    <aside aria-label="Details">
      <div role="tablist" aria-label="Panels" onKeyDown={move}>
        {state.PANELS.map((name) => (
          <button
            key={name}
            id={`tab-${name}`}
            type="button"
            role="tab"
            aria-selected={name === active}
            aria-controls="panel"
            tabIndex={name === active ? 0 : -1}
            onClick={() => {
              state.panel.value = name;
            }}
          >
            {PANELS[name][0]}
          </button>
        ))}
      </div>
      <div id="panel" role="tabpanel" aria-labelledby={`tab-${active}`} tabIndex={0}>
        <Content />
      </div>
    </aside>
  );
}

function GoTo() {
  const isWrong = useSignal(false);
  const { clock, beginUs, endUs } = state.run.value!;
  const input = useRef<HTMLInputElement>(null);
  const run = state.run.value!;
  const go = () => {
    const us = run.clock.parse(input.current!.value, state.moment.value);
    isWrong.value = us === null;
    if (us === null) return;
    state.goTo(us);
    input.current!.blur();
  };
  // Not a form: notebooks and reports show the page in a frame that may not submit any.
  return (
    <div class="goto">
      <input
        id="goto"
        ref={input}
        aria-label="Go to a time, such as day 3 18:30, 7 Jan 18:30, 2 d 14 h"
        placeholder="day 3 18:30"
        aria-invalid={isWrong.value}
        size={12}
        onKeyDown={(event) => {
          if (event.key === "Enter") go();
        }}
      />
      <button type="button" onClick={go}>
        Go
      </button>
      {isWrong.value && (
        <strong role="alert" class="status">
          No time of this run, which lasts from {clock.text(beginUs).slice(0, -3)} to {clock.text(endUs).slice(0, -3)}
        </strong>
      )}
    </div>
  );
}

/** What the browser, or the server, makes of the view. */
function Share() {
  const run = state.run.value!;
  const menu = useRef<HTMLDetailsElement>(null);
  const share = recording.value;
  if (share !== null) {
    return (
      <button type="button" class="recording" onClick={stopClip}>
        ● {Math.round(100 * share)} % · Stop
      </button>
    );
  }
  const choose = (run: () => void) => (): void => {
    menu.current!.open = false;
    run();
  };
  return (
    <details
      ref={menu}
      class="menu"
      onFocusOut={(event) => {
        if (!menu.current!.contains(event.relatedTarget as Node | null)) menu.current!.open = false;
      }}
    >
      <summary class="round" aria-label="Save a picture or a clip" title="Save a picture or a clip">
        <Icon name="film" />
      </summary>
      <div>
        <button type="button" onClick={choose(() => void savePicture())}>
          Picture of the plan <small>PNG</small> <kbd>s</kbd>
        </button>
        <button type="button" onClick={choose(() => void saveClip())}>
          Clip of {state.marked.value ? "the marked range" : "the next hour"} <small>10 s</small> <kbd>w</kbd>
        </button>
        {run.path && !state.live.value && (
          <button type="button" disabled={filming.value} onClick={choose(() => void downloadFilm(run))}>
            {filming.value ? "The server is filming …" : "Film of the minute around this moment"} <small>MP4</small> <kbd>m</kbd>
          </button>
        )}
      </div>
    </details>
  );
}

/** Which card of the story the reel shows. */
function Reel() {
  const at = reel.value;
  if (at < 0) return null;
  const { story } = state.run.value!.facts;
  const card = story[at]!;
  return (
    <output class="reel">
      <b>{card.title}</b>
      <span>{card.words}</span>
      <small>
        {at + 1} of {story.length} · any key stops
      </small>
    </output>
  );
}

function CopyLink() {
  const words = useSignal("Copy link");
  const copy = async (): Promise<void> => {
    words.value = (await copyLink(state.run.value!)) ? "Copied" : "Copy the address above";
    setTimeout(() => {
      words.value = "Copy link";
    }, 2000);
  };
  return (
    <button type="button" class="quiet" title="A link to this moment and view" onClick={() => void copy()}>
      <Icon name="link" /> <span class="words">{words.value}</span>
    </button>
  );
}

function Help() {
  return (
    <details class="help">
      <summary>Keys</summary>
      <Terms rows={KEYS.map(([keys, words]) => [<kbd>{keys}</kbd>, words])} />
    </details>
  );
}

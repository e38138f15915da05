/** One body, door or room: its state, its plan, why it does so, its history. */

import type { EventKind } from "../contract";
import { useEffect } from "preact/hooks";
import { durationText } from "../data/clock";
import type { EventRow } from "../data/events";
import type { Run } from "../data/run";
import { AWAY } from "../data/rooms";
import { lastAtMost } from "../data/search";
import { valueAt } from "../data/stretches";
import { doing, title } from "../data/words";
import * as state from "../state";
import { bodyState } from "./Now";
import { Terms } from "./Terms";

const SHOWN_EVENTS = 12;

export function Inspect() {
  const name = state.selected.value;
  const run = state.inspected.value!;
  void run.version.value;
  if (!name) return <p class="hint">Choose somebody, a door or a room: click on the plan, or on a name.</p>;
  if (run.body(name)) return <BodyView run={run} name={name} />;
  if (run.facts.home.doors.some((door) => door.name === name)) return <DoorView run={run} name={name} />;
  if (run.home.roomIndex(name) >= 0) return <RoomView run={run} name={name} />;
  if (run.facts.home.objects.some((thing) => thing.name === name)) return <FurnitureView run={run} name={name} />;
  return <p class="hint">There is no {name} in this run.</p>;
}

/** What is inspected, and of two runs in which. */
function heading(run: Run, words: string): string {
  return state.runs.value.length > 1 ? `${words} · ${run.facts.title}` : words;
}

/** The name of a room or a piece of furniture as people write it. */
function labelOf(run: Run, name: string): string {
  return run.home.labels[run.home.roomIndex(name)] ?? title(name);
}

function placeText(run: Run, room: number): string {
  return room === AWAY ? "Out of home" : run.home.roomLabel(room);
}

/** The facts that are known. */
function Facts({ rows }: { rows: [string, string][] }) {
  return <Terms rows={rows.filter(([, value]) => value)} />;
}

function BodyView({ run, name }: { run: Run; name: string }) {
  void run.version.value;
  const us = state.told.value;
  const body = run.body(name)!;
  const now = bodyState(run, name, us);
  useEffect(() => void run.readDecisions(), [run]);
  const decision = run.decisions?.at(name, us);
  const rows: [string, string][] = [
    ["kind", body.robot ? "robot" : "user"],
    ["room", now ? placeText(run, now.away ? AWAY : run.home.roomIndex(now.room)) : "not stored"],
    ["since", now ? since(run, name, us) : ""],
    ["activity", now?.activity ? doing(now.activity) : ""],
    ["behavior", decision ? decision.behavior.replaceAll("_", " ") || "none" : ""],
    ["why", decision?.reason.replaceAll("_", " ") ?? ""],
    ["decided", decision ? `${run.clock.text(decision.us)}, ${durationText(us - decision.us)} ago` : ""],
    ["decides", decision && decision.nextUs >= us ? `in ${durationText(decision.nextUs - us)}` : ""],
    ["next", nextPlace(run, name, us)],
    ["place", now && !now.away ? `${now.x.toFixed(2)} m, ${now.y.toFixed(2)} m` : ""],
    ["heading", now && !now.away ? `${now.headingDeg.toFixed(0)}°` : ""],
    ["sees", now?.sees.join(", ") ?? ""],
    ["last note", noteOf(run, name, us)],
    ["behaviors", body.behaviors.join(", ")],
    ["cameras", body.cameras.map((camera) => `${camera.name}: ${camera.near} to ${camera.far} m, ${((camera.angle * 180) / Math.PI).toFixed(0)}°`).join("; ")],
  ];
  return (
    <div data-inspected={name}>
      <h2>{heading(run, run.label(name))}</h2>
      <button
        type="button"
        aria-pressed={state.followed.value === name}
        onClick={() => {
          state.followed.value = state.followed.value === name ? "" : name;
        }}
      >
        {state.followed.value === name ? "Follow no longer" : `Follow ${run.label(name)}`}
      </button>
      <Facts rows={rows} />
      {!run.decisions && run.path !== "" && <p class="hint">The run is repeated to find out which behavior decided, and why …</p>}
      <h3>History</h3>
      <History run={run} rows={run.events.about(name)} us={us} />
    </div>
  );
}

/** The last note of a behavior: an event that is neither sight nor activity. */
function noteOf(run: Run, name: string, us: number): string {
  const routine = new Set<EventKind>(["user_seen", "user_lost", "activity", "left_home", "came_home"]);
  const kinds = run.events.kindsOf(name).filter((kind) => !routine.has(kind));
  const rows = kinds.flatMap((kind) => run.events.last(name, kind, us) ?? []);
  const row = rows.sort((a, b) => b.index - a.index)[0];
  return row ? `${row.event.replaceAll("_", " ")} ${row.detail} (${run.clock.text(row.us)})` : "";
}

function since(run: Run, name: string, us: number): string {
  const lane = run.roomsOf(name);
  const i = lastAtMost(lane.from, us);
  return i < 0 ? "" : `${run.clock.text(lane.from[i]!)}, ${durationText(us - lane.from[i]!)} ago`;
}

function nextPlace(run: Run, name: string, us: number): string {
  const lane = run.roomsOf(name);
  const i = lastAtMost(lane.from, us) + 1;
  if (i >= lane.from.length) return "";
  return `${placeText(run, lane.value[i]!)} in ${durationText(lane.from[i]! - us)}`;
}

export function History({ run, rows, us }: { run: Run; rows: readonly EventRow[]; us: number }) {
  const at = lastAtMost(rows.map((row) => row.us), us) + 1;
  const visibleRows = rows.slice(Math.max(0, at - SHOWN_EVENTS), at + 3);
  return (
    <ol class="events">
      {visibleRows.map((row) => (
        <li key={row.index} class={row.us > us ? "later" : ""}>
          <button type="button" class="link" onClick={() => state.goTo(row.us)}>
            <time>{run.clock.text(row.us)}</time> {row.event.replaceAll("_", " ")} {row.user} {row.detail}
          </button>
        </li>
      ))}
      {visibleRows.length === 0 && <li>no events</li>}
    </ol>
  );
}

function DoorView({ run, name }: { run: Run; name: string }) {
  void run.version.value;
  const us = state.told.value;
  return (
    <div data-inspected={name}>
      <h2>{heading(run, run.label(name))}</h2>
      <Facts rows={[["kind", "door"], ["now", run.doorOpen(name, us) ? "open" : "shut"]]} />
      <h3>History</h3>
      <History run={run} rows={run.events.ofEntity(name)} us={us} />
    </div>
  );
}

const BLOCKS: Record<string, string> = { nothing: "nothing", path: "ways", sight: "ways and sight" };

function FurnitureView({ run, name }: { run: Run; name: string }) {
  const thing = run.facts.home.objects.find((entry) => entry.name === name)!;
  return (
    <div data-inspected={name}>
      <h2>{heading(run, labelOf(run, name))}</h2>
      <Facts rows={[["kind", thing.type.replaceAll("_", " ")], ["blocks", BLOCKS[thing.blocks] ?? thing.blocks]]} />
    </div>
  );
}

function RoomView({ run, name }: { run: Run; name: string }) {
  void run.version.value;
  const us = state.told.value;
  const index = run.home.roomIndex(name);
  const room = run.facts.home.rooms[index]!;
  const occupants = run.bodies.filter((body) => valueAt(run.roomsOf(body.name), us) === index);
  return (
    <div data-inspected={name}>
      <h2>{heading(run, labelOf(run, name))}</h2>
      <Facts
        rows={[
          ["kind", room.type.replaceAll("_", " ")],
          ["area", `${room.area_m2.toFixed(1)} m²`],
          ["light", run.hasLights ? (run.unlitAt(us).includes(index) ? "off" : "on") : ""],
          ["here now", occupants.map((body) => run.label(body.name)).join(", ") || "nobody"],
        ]}
      />
    </div>
  );
}

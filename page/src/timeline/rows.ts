/** Which lanes are shown, in which order: groups that fold, lanes that are pinned or hidden, a filter. */

import { signal } from "@preact/signals";
import type { Lane } from "./lanes";

export const GROUPS = ["Answers", "Beliefs", "Users", "Robots", "Doors and sensors", "Algorithms", "Metrics", "Script"] as const;
export type Group = (typeof GROUPS)[number];

/** With more bodies, or more lanes in another group, they are folded at first. */
const MOST_OPEN = 4;
const MOST_LANES = 12;
const HEADER_HEIGHT = 18;

/** Groups and bodies that are folded otherwise than at first. */
export const toggled = signal<ReadonlySet<string>>(new Set());
export const pinned = signal<ReadonlySet<string>>(new Set());
export const hidden = signal<ReadonlySet<string>>(new Set());
/** Only lanes whose labels have this text are shown. */
export const filter = signal("");

export interface Row {
  key: string;
  label: string;
  height: number;
  lane: Lane | null;
  /** Whether the row folds others, which it then says it has. */
  folds: "open" | "folded" | null;
  isPinned: boolean;
  indent: number;
}

export function change(set: { value: ReadonlySet<string> }, name: string): void {
  const changed = new Set(set.value);
  if (!changed.delete(name)) changed.add(name);
  set.value = changed;
}

/** The rows of the timeline, the pinned ones first. */
export function rowsOf(lanes: readonly Lane[]): Row[] {
  const words = filter.value.trim().toLowerCase();
  const shown = lanes.filter((lane) => !hidden.value.has(lane.id));
  const rows: Row[] = shown.filter((lane) => pinned.value.has(lane.id)).map((lane) => rowOf(lane, 0, null, true));
  const rest = shown.filter((lane) => !pinned.value.has(lane.id) && lane.label.toLowerCase().includes(words));
  for (const group of GROUPS) {
    const ofGroup = rest.filter((lane) => lane.group === group);
    if (ofGroup.length > 0) rows.push(...rowsOfGroup(group, ofGroup, words !== ""));
  }
  return rows;
}

function rowsOfGroup(group: Group, lanes: readonly Lane[], isFiltered: boolean): Row[] {
  const isOfBodies = group === "Users" || group === "Robots";
  const bodies = new Map<string, Lane[]>();
  for (const lane of lanes) {
    const key = isOfBodies ? lane.subject : lane.id;
    const ofBody = bodies.get(key);
    if (ofBody) ofBody.push(lane);
    else bodies.set(key, [lane]);
  }
  if (group === "Answers" || group === "Beliefs") return lanes.map((lane) => rowOf(lane, 0, null));
  const isFolded = !isFiltered && toggled.value.has(group) !== (!isOfBodies && lanes.length > MOST_LANES);
  const header: Row = {
    key: group,
    label: `${group} (${bodies.size})`,
    height: HEADER_HEIGHT,
    lane: null,
    folds: isFolded ? "folded" : "open",
    isPinned: false,
    indent: 0,
  };
  if (isFolded) return [header];
  const rows = [header];
  for (const [name, ofBody] of bodies) {
    const main = ofBody.filter((lane) => lane.isMain);
    if (!isOfBodies || main.length === 0 || main.length === ofBody.length) {
      rows.push(...ofBody.map((lane) => rowOf(lane, 1, null)));
      continue;
    }
    const isBodyFolded = !isFiltered && toggled.value.has(`${group}/${name}`) !== bodies.size > MOST_OPEN;
    main.forEach((lane, i) => rows.push(rowOf(lane, 1, i > 0 ? null : isBodyFolded ? "folded" : "open")));
    if (!isBodyFolded) rows.push(...ofBody.filter((lane) => !lane.isMain).map((lane) => rowOf(lane, 2, null)));
  }
  return rows;
}

function rowOf(lane: Lane, indent: number, folds: Row["folds"], isPinned = false): Row {
  const key = folds ? `${lane.group}/${lane.subject}` : lane.id;
  return { key, label: lane.label, height: lane.height, lane, folds, isPinned, indent };
}

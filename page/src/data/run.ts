/** One run: everything that the page shows of it, read when it is needed. */

import { signal } from "@preact/signals";
import type { BodyFacts, EventKind, NoteFacts, RunFacts, SightingFacts, TableFacts, WallsFacts } from "../contract";
import { type Beliefs, readBeliefs } from "./beliefs";
import { Clock } from "./clock";
import { Decisions, readDecisions } from "./decisions";
import { type EventRow, Events, readEvents } from "./events";
import { Home } from "./home";
import { LayerTable } from "./layers";
import { MovedObjects } from "./moved";
import { Observations, type ObservationSource } from "./observations";
import { Table } from "./parquet";
import { Postures } from "./postures";
import { roomStretches } from "./rooms";
import { lastAtMost } from "./search";
import { Walls } from "./sight";
import type { RunSource } from "./source";
import type { Stretches } from "./stretches";
import { readTracks, Track, tracksOf } from "./tracks";
import { bodyLabels, title } from "./words";

/** When something was switched, and whether on. */
export interface Switches {
  us: number[];
  on: boolean[];
}

/** Whether something is on at a moment; undefined before it was switched first. */
function isOn({ us: moments, on }: Switches, us: number): boolean | undefined {
  return on[lastAtMost(moments, us)];
}

const NO_STRETCHES: Stretches = { from: [], to: [], value: [] };

export class Run {
  readonly clock: Clock;
  readonly home: Home;
  private readonly labels: ReadonlyMap<string, string>;
  tracks = new Map<string, Track>();
  rooms = new Map<string, Stretches>();
  events = new Events();
  beliefs: Beliefs[] = [];
  sightings: SightingFacts[] = [];
  observations: ObservationSource | null = null;
  /** When people sit or lie; null while it isn't read, and in a live run. */
  postures: Postures | null = null;
  /** Goes up by one whenever something more of the run was read. */
  readonly version = signal(0);
  /** Whether everything was read that questions are about. */
  readonly isRead = signal(false);
  /** What could not be read, in plain words. */
  readonly problems = signal<string[]>([]);
  /** Paths ahead of bodies in a live run [lattice]; those of a stored run follow from its tracks. */
  ahead = new Map<string, number[]>();
  /** What bodies decided; null until it is read. */
  decisions: Decisions | null = null;
  private asksForDecisions = false;

  /** What is known of the run ends here: the step that its simulation has come to. */
  knownUs = Infinity;

  /** The moment that the layer on the plan is of [us]; null while there is none. */
  readonly layerUs = signal<number | null>(null);

  /** Notes and bookmarks, which are stored beside the run. */
  readonly notes = signal<readonly NoteFacts[]>([]);

  private readonly walls = new Map<number, Walls | null>();
  private readonly layers = new Map<string, Promise<LayerTable>>();

  constructor(
    readonly facts: RunFacts,
    private readonly source: RunSource,
  ) {
    this.clock = new Clock(facts.start, facts.step_us, facts.steps, facts.offsets);
    this.home = new Home(facts.home);
    this.labels = bodyLabels(facts.bodies.map(({ name }) => name));
  }

  /** The name of a body as people write it. */
  label(name: string): string {
    return this.labels.get(name) ?? title(name);
  }

  static async open(source: RunSource): Promise<Run> {
    return new Run(await source.facts(), source);
  }

  /** The path of the run on the server; empty where there is no server. */
  get path(): string {
    return this.source.path;
  }

  get beginUs(): number {
    return this.facts.first_step * this.clock.stepUs;
  }

  get endUs(): number {
    return Math.min(this.facts.end_step, this.clock.steps) * this.clock.stepUs;
  }

  /** The end of what is known [us]. */
  get presentUs(): number {
    return Math.min(this.clock.endUs, this.knownUs);
  }

  /** Whether an algorithm says where users are now, and not for which shares of their time. */
  isOfNow(algorithm: string): boolean {
    const algorithms = this.facts.scenario.algorithms as Record<string, { type?: string } | undefined> | undefined;
    return ["real_time_presence", "belief_table", "told_presence"].includes(algorithms?.[algorithm]?.type ?? "");
  }

  /** Whether it is known who was noticed. */
  get storesSightings(): boolean {
    return this.knownUs < Infinity || this.tableFacts("observations") !== undefined;
  }

  get bodies(): readonly BodyFacts[] {
    return this.facts.bodies;
  }

  body(name: string): BodyFacts | undefined {
    return this.facts.bodies.find((body) => body.name === name);
  }

  changed(): void {
    this.version.value++;
  }

  /** Read where everybody is; until then only the home can be shown. */
  async readPoses(): Promise<void> {
    const name = this.facts.walks_every_s > 0 ? "poses" : "key_frames";
    const facts = this.facts.tables.find((table) => table.name === "key_frames");
    if (!facts) {
      this.report("The run stored no key frames: nobody can be shown. Run it with artifacts.key_frames: true.");
      return;
    }
    await this.attempt(async () => {
      const names = this.bodies.map((body) => body.name);
      const arrays = await this.source.tracks();
      if (arrays) {
        this.tracks = tracksOf(arrays, names, this.clock.stepUs);
        return;
      }
      const table = await Table.open(await this.source.table(name, name === "poses" ? 0 : facts.bytes));
      this.tracks = await readTracks(
        table,
        names,
        {
          unitsPerM: this.facts.home.units_per_m,
          originUnits: this.facts.home.origin_units,
          startMs: this.clock.startMs,
          stepUs: this.clock.stepUs,
        },
      );
    });
    this.changed();
  }

  /** Read what the first picture does without: events, lanes, beliefs. */
  async readRest(): Promise<void> {
    await this.attempt(async () => {
      const table = await this.open("events");
      if (table) this.events = await readEvents(table, this.clock);
    });
    this.changed();
    await this.attempt(async () => {
      this.sightings = await this.source.sightings();
    });
    await this.attempt(async () => {
      this.notes.value = await this.source.notes();
    });
    await this.attempt(async () => {
      const facts = await this.source.postures();
      this.postures = facts && new Postures(facts);
    });
    if (this.tableFacts("decisions")) await this.readDecisions();
    for (const facts of this.facts.tables.filter((entry) => entry.role === "algorithm")) {
      await this.attempt(async () => {
        const table = await this.open(facts.name);
        const users = this.bodies.filter((body) => !body.robot).map((body) => body.name);
        const beliefs = table && (await readBeliefs(facts.name, table, this.home, users, this.clock.stepUs, this.isOfNow(facts.name)));
        if (beliefs) this.beliefs.push(beliefs);
      });
    }
    await this.attempt(async () => {
      const table = await this.open("observations");
      if (table) this.observations = new Observations(table);
    });
    this.isRead.value = true;
    this.changed();
  }

  /** Read why bodies did what they did; where the run didn't store that, the server repeats it. */
  async readDecisions(): Promise<void> {
    if (this.asksForDecisions || this.decisions) return;
    const facts = this.tableFacts("decisions");
    if (!facts && !this.path) return;
    this.asksForDecisions = true;
    await this.attempt(async () => {
      const table = await Table.open(await this.source.table("decisions", facts?.bytes ?? 0));
      this.decisions = await readDecisions(table, this.clock.stepUs);
    });
    this.changed();
  }

  /** Open a table of the run; null where there is none or it is empty. */
  async open(name: string): Promise<Table | null> {
    const facts = this.tableFacts(name);
    if (!facts || facts.rows === 0) return null;
    return Table.open(await this.source.table(name, facts.bytes));
  }

  tableFacts(name: string): TableFacts | undefined {
    return this.facts.tables.find((table) => table.name === name);
  }

  /** The rooms of a body, computed when they are first needed. */
  roomsOf(name: string): Stretches {
    const rooms = this.rooms.get(name);
    if (rooms) return rooms;
    const track = this.tracks.get(name);
    if (!track) return NO_STRETCHES;
    const computed = roomStretches(track, this.home, this.clock);
    this.rooms.set(name, computed);
    return computed;
  }

  private readonly seenBy = new Map<string, { read: readonly SightingFacts[]; stretches: Stretches }>();

  /** When any robot noticed somebody; taken for somebody else doesn't count. */
  seen(name: string): Stretches {
    let known = this.seenBy.get(name);
    if (known?.read !== this.sightings) {
      const { stepUs } = this.clock;
      const spans = this.sightings
        .filter((lane) => lane.user === name)
        .flatMap((lane) => lane.first.flatMap((first, i) => (lane.false[i] ? [] : [[first * stepUs, (lane.last[i]! + 1) * stepUs] as const])));
      spans.sort(([one], [other]) => one - other);
      const stretches = { from: spans.map(([from]) => from), to: spans.map(([, to]) => to), value: spans.map(() => 1) };
      this.seenBy.set(name, (known = { read: this.sightings, stretches }));
    }
    return known.stretches;
  }

  /** What ends sight at a moment; null while it isn't read yet. */
  wallsAt(us: number): Walls | null {
    const { walls } = this.facts;
    const steps = walls.map((entry) => entry.step);
    const change = walls[Math.max(0, lastAtMost(steps, Math.floor(us / this.clock.stepUs)))];
    return change ? this.wallsOf(change.walls) : null;
  }

  wallsOf(number: number): Walls | null {
    const cached = this.walls.get(number);
    if (cached !== undefined) return cached;
    this.walls.set(number, null);
    void this.attempt(async () => {
      this.walls.set(number, new Walls(await this.readWalls(number)));
      this.changed();
    });
    return null;
  }

  /** Store notes in place of the present ones. */
  async storeNotes(notes: readonly NoteFacts[]): Promise<void> {
    await this.attempt(async () => {
      this.notes.value = await this.source.storeNotes(notes);
    });
  }

  readWalls(number: number): Promise<WallsFacts> {
    return this.source.walls(number);
  }

  layer(name: string): Promise<LayerTable> {
    let layer = this.layers.get(name);
    if (!layer) {
      layer = this.open(`layer.${name}`).then((table) => {
        if (!table) throw new Error(`the layer ${name} is empty`);
        return LayerTable.open(table, this.home);
      });
      this.layers.set(name, layer);
    }
    return layer;
  }

  private movedBy: { seen: number; moved: MovedObjects } | null = null;

  /** Where furniture is over time, as far as the run is read. */
  get moved(): MovedObjects {
    const seen = this.events.rows.length;
    if (this.movedBy?.seen !== seen) this.movedBy = { seen, moved: new MovedObjects(this.facts.home.objects, this.events.ofKind("moved")) };
    return this.movedBy!.moved;
  }

  /** Whether a door stands open at a moment. */
  doorOpen(name: string, us: number): boolean {
    const facts = this.facts.home.doors.find((door) => door.name === name);
    return isOn(this.doorEvents(name), us) ?? facts?.open ?? true;
  }

  /** Whether lights of rooms are ever switched. */
  get hasLights(): boolean {
    return this.facts.starts_unlit || this.events.has("light_off");
  }

  /** The rooms whose lights are off at a moment. */
  unlitAt(us: number): number[] {
    if (!this.hasLights) return [];
    const { rooms } = this.facts.home;
    return [...rooms.keys()].filter((i) => !(isOn(this.lightEvents(rooms[i]!.name), us) ?? !this.facts.starts_unlit));
  }

  lightEvents(room: string): Switches {
    return this.switches(`light of ${room}`, "", (row) => row.detail === room, "light_on", "light_off");
  }

  doorEvents(name: string): Switches {
    return this.switches(name, name, () => true, "opened", "shut");
  }

  private readonly switched = new Map<string, Switches & { seen: number }>();

  /** When something was switched on and off, by the events of an entity. */
  private switches(key: string, entity: string, isAbout: (row: EventRow) => boolean, on: EventKind, off: EventKind): Switches {
    let found = this.switched.get(key);
    if (!found || found.seen !== this.events.rows.length) {
      const rows = this.events.ofEntity(entity).filter((row) => (row.event === on || row.event === off) && isAbout(row));
      found = { us: rows.map((row) => row.us), on: rows.map((row) => row.event === on), seen: this.events.rows.length };
      this.switched.set(key, found);
    }
    return found;
  }

  report(problem: string): void {
    if (!this.problems.value.includes(problem)) this.problems.value = [...this.problems.value, problem];
  }

  /** Do something that may fail, and report why it did. */
  async attempt(work: () => Promise<void>): Promise<void> {
    try {
      await work();
    } catch (error) {
      this.report(error instanceof Error ? error.message : String(error));
    }
  }
}

// Written by `python -m tools.contract_types` from fleet2d.viewing.contract.

/** Every kind of event that Fleet2D records. */
export type EventKind = "user_lost" | "user_seen" | "robot_lost" | "robot_seen" | "activity" | "came_home" | "known" | "left_home" | "reacts" | "unknown" | "uses" | "accepted" | "allowed" | "approaches" | "asks" | "banned" | "battery" | "broken_off" | "called" | "calls" | "charged" | "collects" | "deadlock" | "declined" | "deferred" | "delivered" | "docks" | "due" | "expired" | "explored" | "explores" | "find_begins" | "follows" | "found" | "gave_up" | "given_up" | "gives_up" | "gives_way" | "ignored" | "interaction_over" | "interacts" | "localization_lost" | "lost" | "mistaken" | "not_at_home" | "opportunity" | "overlaps" | "power_off" | "power_on" | "question" | "relocalized" | "relocates" | "replay" | "replies" | "retraced" | "retraces" | "sent_away" | "switched_off" | "told" | "visits" | "way_blocked" | "withdraws" | "light_off" | "light_on" | "locked" | "moved" | "opened" | "room_changed" | "sensor" | "shut" | "unlocked";

/** A room: its colours on the plan and in lanes, and the anchor of its name [m]. */
export interface RoomFacts {
  name: string;
  type: string;
  color: string;
  deep_color: string;
  anchor: [number, number];
  area_m2: number;
}

/** A door: its jambs [m], and whether it is open and locked when the run starts. */
export interface DoorFacts {
  name: string;
  start: [number, number];
  end: [number, number];
  open: boolean;
  locked: boolean;
}

/** A passage between two rooms: its jambs [m], and whether a door can shut it. */
export interface DoorwayFacts {
  start: [number, number];
  end: [number, number];
  leaf: boolean;
}

/** A place from which a piece of furniture is used [m], and how a person is there [rad]. */
export interface UseFacts {
  x: number;
  y: number;
  heading: number;
  posture: string;
}

/** A shape of a symbol [m]: left, bottom, right and top of a box or an ellipse, ends of a line. Boxes have corners of a `radius`. Colours are hexadecimal, with or without an opacity. */
export interface ShapeFacts {
  kind: "box" | "ellipse" | "line";
  at: [number, number, number, number];
  fill: string | null;
  edge: string | null;
  radius: number;
}

/** A piece of furniture: its outline and middle [m], the direction of its front [rad], its uses. `blocks` says whether it is in the way of nothing, paths or sight. `symbol` is the number of its symbol among those of its home, which is drawn at its middle; -1: it is drawn as its outline. */
export interface ObjectFacts {
  name: string;
  type: string;
  outline: [number, number][];
  middle: [number, number];
  symbol: number;
  blocks: string;
  front: number;
  uses: UseFacts[];
}

/** A home: outlines in metres, cells as runs of equal rooms. `free` lists polygons, each an outline and its holes. `room_cells` are pairs (room, number of cells), row by row from the lowest; -1 is no room. `place_cells` are such pairs, too, in which cells that a wall cuts have the room of a cell beside them: somebody may be in their free part. */
export interface HomeFacts {
  name: string;
  cell: number;
  origin_units: [number, number];
  units_per_m: number;
  columns: number;
  rows: number;
  bounds: [number, number, number, number];
  area_m2: number;
  free: [number, number][][][];
  rooms: RoomFacts[];
  room_cells: number[];
  place_cells: number[];
  doorways: DoorwayFacts[];
  doors: DoorFacts[];
  objects: ObjectFacts[];
  symbols: ShapeFacts[][];
  no_go: [number, number][][];
  entrance: [number, number] | null;
}

/** A camera: range [m], angles [rad], offset forward and to the left [m]. */
export interface CameraFacts {
  name: string;
  near: number;
  far: number;
  angle: number;
  forward: number;
  left: number;
  heading: number;
  pan: number[];
  pan_us: number;
}

/** A user or a robot; `keys` are those of its behaviors while the run is under way. */
export interface BodyFacts {
  name: string;
  robot: boolean;
  color: string;
  radius: number;
  cameras: CameraFacts[];
  behaviors: string[];
  keys: Record<string, Record<string, unknown>>;
}

/** A column of a table. */
export interface ColumnFacts {
  name: string;
  kind: string;
  unit: string;
  description: string;
}

/** A table of the run, and the kind of component that wrote it. */
export interface TableFacts {
  name: string;
  rows: number;
  bytes: number;
  role: "log" | "algorithm" | "metric" | "layer";
  columns: ColumnFacts[];
}

/** The number of the walls that block sight from this step on. */
export interface WallsChange {
  step: number;
  walls: number;
}

/** Walls that block sight, as a mesh [lattice]: x and y of vertices, indices of triangles. */
export interface WallsFacts {
  vertices: number[];
  triangles: number[];
  neighbors: number[];
}

/** A mark on the timeline: an intervention, or a stretch in which an expectation held or not. It lasts from `step` to before `end`. Marks of a `lane` don't overlap, except interventions. */
export interface MarkFacts {
  lane: string;
  step: number;
  end: number;
  kind: "intervention" | "held" | "violated" | "open";
  label: string;
}

/** What became of an expectation; `step` is the first at which it is violated. */
export interface VerdictFacts {
  name: string;
  outcome: "violated" | "held" | "not decided" | "untested";
  says: string;
  step: number | null;
}

/** A moment that is worth a look, and the bodies that it is about, the most important first. */
export interface StoryFacts {
  step: number;
  title: string;
  words: string;
  who: string[];
}

/** A floor that slows robots down from `step` to before `end`: its outline [m], its effect. */
export interface SlowFacts {
  outline: [number, number][];
  words: string;
  step: number;
  end: number;
}

/** Stretches in which people sit or lie [us since the start], by user and time. `use` is the number of the place in `uses`. */
export interface PostureFacts {
  uses: UseFacts[];
  user: string[];
  use: number[];
  from_us: number[];
  to_us: number[];
}

/** Stretches in which a robot noticed a user: steps `first` to `last`, both included. `false` marks stretches in which the robot took something else for that user. */
export interface SightingFacts {
  robot: string;
  user: string;
  first: number[];
  last: number[];
  false: boolean[];
}

/** Everything about a run but its tables; steps `first_step` to `end_step` - 1 are shown. With `starts_unlit` all lights are off at first; its events switch them. `event_kinds` are all that Fleet2D records, also those that the run has none of. `verdict` sums up the `verdicts`, of which violated ones come first. `skies` has for each day the hours until which it is dark, from which and until which it is light, and from which it is dark again; the last holds for the days that follow, too. `start` is UTC if the home has a time zone; `offsets` has then from when on [us since the start] which offset [us] holds, else nothing. */
export interface RunFacts {
  title: string;
  status: string;
  notes: string[];
  start: string;
  offsets: [number, number][];
  step_us: number;
  steps: number;
  first_step: number;
  end_step: number;
  seed: number | null;
  digest: string | null;
  version: string;
  home: HomeFacts;
  bodies: BodyFacts[];
  tables: TableFacts[];
  walls: WallsChange[];
  marks: MarkFacts[];
  verdict: string;
  verdicts: VerdictFacts[];
  story: StoryFacts[];
  slows: SlowFacts[];
  skies: [number, number, number, number][];
  starts_unlit: boolean;
  event_kinds: EventKind[];
  metrics: Record<string, unknown>;
  scenario: Record<string, unknown>;
  walks_every_s: number;
}

/** A note at a step of a run; without a text it is a bookmark. */
export interface NoteFacts {
  step: number;
  text: string;
}

/** The reason why something can't be shown. */
export interface Problem {
  message: string;
}

/** The stored runs that the page shows, by title, and those that are under way. */
export interface SessionFacts {
  runs: string[];
  live: LiveSession[];
  version: string;
}

/** A run that is under way, at a path of the server. A branch repeats the run at the path `of` until before the step `since`. */
export interface LiveSession {
  path: string;
  title: string;
  of: string;
  since: number;
}

/** A wish of the page to continue the run at a path of the server from a step. */
export interface BranchOrder {
  of: string;
  step: number;
}

/** A body at a step of a running simulation [lattice], and its path ahead: time [us], x, y. It follows a plan of its `behavior`, whose last note is the `reason`. At the step `decides` its behaviors are asked next, if nothing interrupts it; -1: at none. */
export interface LiveBody {
  name: string;
  x: number;
  y: number;
  heading: number;
  away: boolean;
  ahead: [number, number, number][];
  behavior: string;
  reason: string;
  decides: number;
}

/** An event of a running simulation. */
export interface LiveEvent {
  step: number;
  entity: string;
  event: string;
  user: string;
  detail: string;
}

/** The state of a running simulation; `speed` 0 is as fast as it goes. `beliefs` are of algorithms about users: shares of rooms and last of away, which sum to 1. `served_as` is the number of the stored run that it has become; -1 while it is under way. */
export interface LiveFrame {
  step: number;
  paused: boolean;
  done: boolean;
  speed: number;
  achieved: number;
  bodies: LiveBody[];
  seen: [string, string][];
  doors: Record<string, boolean>;
  beliefs: Record<string, Record<string, number[]>>;
  events: LiveEvent[];
  marks: MarkFacts[];
  slows: SlowFacts[];
  walls: number;
  message: string;
  served_as: number;
}

/** A command of the page to a running simulation; `x` and `y` in metres. `configure` changes the `key` of a behavior, such as `hangout.tau`, to the value that `text` is in YAML. */
export interface LiveOrder {
  action: "pause" | "resume" | "step" | "speed" | "door" | "place" | "call" | "replan" | "configure" | "end";
  target: string;
  value: number;
  x: number;
  y: number;
  key: string;
  text: string;
}

/** How homes are drawn: `fleet2d.viewing.look`. */
export const LOOK = {
  "planks": {
    "pitch": 0.19,
    "joint": 0.012,
    "colors": [
      "#e8d3b3",
      "#e5cfae",
      "#ebd8ba",
      "#e2caa6"
    ]
  },
  "unknown": "#f4f4f2",
  "carpet": {
    "rooms": [
      "bedroom",
      "child_room",
      "guest_room",
      "wardrobe"
    ],
    "colors": [
      "#dcdde8",
      "#e3dce0",
      "#dbe2e2"
    ]
  },
  "tiles": {
    "kitchen": {
      "color": "#eeeae2",
      "pitch": 0.6
    },
    "bathroom": {
      "color": "#dce9ea",
      "pitch": 0.3
    },
    "toilet": {
      "color": "#dce9ea",
      "pitch": 0.3
    },
    "laundry": {
      "color": "#dce9ea",
      "pitch": 0.3
    },
    "entryway": {
      "color": "#dfdbd3",
      "pitch": 0.75
    },
    "lobby": {
      "color": "#dfdbd3",
      "pitch": 0.75
    },
    "storage": {
      "color": "#dfdbd3",
      "pitch": 0.75
    },
    "boiler_room": {
      "color": "#dfdbd3",
      "pitch": 0.75
    },
    "garage": {
      "color": "#d6d7d6",
      "pitch": 1.2
    },
    "balcony": {
      "color": "#d5dccb",
      "pitch": 0.5
    },
    "loggia": {
      "color": "#d5dccb",
      "pitch": 0.5
    },
    "terrace": {
      "color": "#d5dccb",
      "pitch": 0.5
    }
  },
  "walls": {
    "thickness": 0.15,
    "lift": 0.17,
    "top": "#fcfbf8",
    "face": "#bdb4a6",
    "edge": "#a79e90",
    "shadow": "#3c2d196b"
  },
  "door": "#a9783f",
  "outline": {
    "fill": "#d9d2c6",
    "edge": "#8b857b"
  },
  "activities": [
    {
      "name": "Sleep",
      "color": "#4c5788",
      "activities": [
        "sleep",
        "nap"
      ]
    },
    {
      "name": "Care",
      "color": "#74aeb8",
      "activities": [
        "toilet",
        "wash_hands",
        "wash",
        "shower",
        "bath",
        "dress",
        "medication",
        "freshen_up"
      ]
    },
    {
      "name": "Meals",
      "color": "#cf8344",
      "activities": [
        "drink",
        "breakfast",
        "cook",
        "dinner",
        "supper",
        "lunch",
        "snack",
        "dishes",
        "eat"
      ]
    },
    {
      "name": "Work, school",
      "color": "#8a7ab5",
      "activities": [
        "work_at_home",
        "homework",
        "computer",
        "study"
      ]
    },
    {
      "name": "Leisure",
      "color": "#e8d38c",
      "activities": [
        "read",
        "tv",
        "phone_call",
        "play",
        "rest",
        "phone",
        "hobby",
        "games",
        "music"
      ]
    },
    {
      "name": "Chores",
      "color": "#b5957d",
      "activities": [
        "fetch",
        "pick_up",
        "put_away",
        "tidy",
        "check_door",
        "laundry",
        "clean",
        "iron"
      ]
    },
    {
      "name": "Sport",
      "color": "#2f6b55",
      "activities": [
        "sport",
        "exercise"
      ]
    }
  ],
  "out": {
    "name": "Out of home",
    "color": "#e4e0d7",
    "activities": []
  },
  "other": {
    "name": "Other",
    "color": "#9aa3ad",
    "activities": []
  }
} as const;

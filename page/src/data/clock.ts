/** Steps and local times of a run. Times are microseconds since its start; local ones, of the offset added. */

const DAY_MS = 86_400_000;
export const DAY_US = 86_400e6;
const WEEKDAYS = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
const MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];

const two = (value: number): string => String(value).padStart(2, "0");

export class Clock {
  /** The start as tables have it, in milliseconds since 1970: UTC, or local time if the home has no time zone. */
  readonly startMs: number;

  /** `offsets`: from when on which offset from UTC holds; none if the home has no time zone. */
  constructor(
    start: string,
    readonly stepUs: number,
    public steps: number,
    private readonly offsets: readonly [number, number][] = [],
  ) {
    this.startMs = Date.parse(start.endsWith("Z") ? start : `${start}Z`);
  }

  get endUs(): number {
    return this.steps * this.stepUs;
  }

  /** The step that a moment belongs to; the last one at the end of the run. */
  stepAt(us: number): number {
    return Math.max(0, Math.min(this.steps - 1, Math.floor(us / this.stepUs)));
  }

  /** The moment in local time. */
  private local(us: number): number {
    const since = this.offsets.filter(([from], i) => i === 0 || from <= us);
    return us + (since.length ? since[since.length - 1]![1] : 0);
  }

  /** The first moment at which the clock reads a local time, or is put past it. */
  private moment(local: number): number {
    for (const [i, [from, offset]] of this.offsets.entries()) {
      const us = local - offset;
      if (us < (this.offsets[i + 1]?.[0] ?? Infinity)) return i ? Math.max(us, from) : us;
    }
    return local;
  }

  date(us: number): Date {
    return new Date(this.startMs + this.local(us) / 1000);
  }

  /** The day of the run that a moment is in: 1 is the date it starts on. */
  day(us: number): number {
    return Math.floor(this.date(us).getTime() / DAY_MS) - this.firstDay + 1;
  }

  /** Midnight that begins a day of the run; the first may lie before the start. */
  dayStart(day: number): number {
    return this.moment(this.localDayStart(day));
  }

  /** The first and the last moment of the day that a moment is in, which may last 23 or 25 hours. */
  dayOf(us: number): [number, number] {
    const day = this.day(us);
    return [this.dayStart(day), this.dayStart(day + 1)];
  }

  /** The moment some days later, at which the clock reads the same. */
  daysLater(us: number, days: number): number {
    const day = this.day(us);
    return this.ofShare(this.share(us, day), day + days);
  }

  /** Where in a day a moment is by what the clock reads, from 0 to 1 at the next midnight. */
  share(us: number, day: number): number {
    return (this.local(us) - this.localDayStart(day)) / (DAY_MS * 1000);
  }

  /** The moment at a share of a day. */
  ofShare(share: number, day: number): number {
    return this.moment(this.localDayStart(day) + share * DAY_MS * 1000);
  }

  private get firstDay(): number {
    return Math.floor(this.date(0).getTime() / DAY_MS);
  }

  private localDayStart(day: number): number {
    return ((this.firstDay + day - 1) * DAY_MS - this.startMs) * 1000;
  }

  /** The time of day in hours. */
  hourAt(us: number): number {
    return (this.local(us) - this.localDayStart(this.day(us))) / 3600e6;
  }

  timeText(us: number, seconds = true): string {
    const date = this.date(us);
    const text = `${two(date.getUTCHours())}:${two(date.getUTCMinutes())}`;
    return seconds ? `${text}:${two(date.getUTCSeconds())}` : text;
  }

  dateText(us: number): string {
    const date = this.date(us);
    const day = WEEKDAYS[date.getUTCDay()];
    return `${day} ${date.getUTCDate()} ${MONTHS[date.getUTCMonth()]}`;
  }

  text(us: number): string {
    return `${this.dateText(us)} ${this.timeText(us)}${this.offsetText(us)}`;
  }

  /** The offset from UTC, as " +02:00"; empty if the home has no time zone. */
  private offsetText(us: number): string {
    if (!this.offsets.length) return "";
    const minutes = Math.round((this.local(us) - us) / 60e6);
    const size = Math.abs(minutes);
    return ` ${minutes < 0 ? "-" : "+"}${two(Math.floor(size / 60))}:${two(size % 60)}`;
  }

  /** Local time as ISO 8601, without a time zone. */
  iso(us: number): string {
    return this.date(us).toISOString().slice(0, 19);
  }

  /** A moment exactly, as in an address: in local time, or in UTC, with a Z, if the home has a time zone. */
  stampText(us: number): string {
    const text = new Date(this.startMs + us / 1000).toISOString().slice(0, 23).replace(".000", "");
    return this.offsets.length ? `${text}Z` : text;
  }

  /** The moment that an address names; without a Z in local time. Null where it names none. */
  ofStamp(text: string): number | null {
    const ms = Date.parse(text.endsWith("Z") ? text : `${text}Z`);
    const us = (ms - this.startMs) * 1000;
    return Number.isNaN(ms) ? null : text.endsWith("Z") ? us : this.moment(us);
  }

  /**
   * The moment that a text names: "2026-01-07T18:30", "Wed 7 Jan 18:30", "day 3 18:30", "18:30" on the
   * day of `nearUs`, "2 d 14 h" since the start, or "step 5000". Null where it names none.
   */
  parse(text: string, nearUs = 0): number | null {
    const words = text.trim().toLowerCase();
    const step = /^step (\d+)$/.exec(words);
    if (step) return this.inside(Number(step[1]) * this.stepUs);
    const iso = /^(\d{4}-\d{2}-\d{2})(?:[t ](\d{1,2}:\d{2}(?::\d{2})?))?$/.exec(words);
    if (iso) {
      const ms = Date.parse(`${iso[1]}T${(iso[2] ?? "00:00").padStart(5, "0")}Z`);
      return Number.isNaN(ms) ? null : this.inside(this.moment((ms - this.startMs) * 1000));
    }
    const since = /^(?:(\d+) ?d)? ?(?:(\d+) ?h)? ?(?:(\d+) ?min)? ?(?:(\d+) ?s)?$/.exec(words);
    if (since && words) {
      const [days, hours, minutes, seconds] = since.slice(1).map((part) => Number(part ?? 0));
      return this.inside((((days! * 24 + hours!) * 60 + minutes!) * 60 + seconds!) * 1e6);
    }
    const date = /^(?:[a-z]{3},? )?(\d{1,2})\.? ([a-z]{3})[a-z]*(?: (\d{4}))?(?:,? (\d{1,2}:\d{2}(?::\d{2})?))?$/.exec(words);
    if (date) return this.ofDate(Number(date[1]), date[2]!, date[3], date[4] ?? "00:00");
    const day = /^(?:day (\d+))?\s*(?:(\d{1,2}):(\d{2})(?::(\d{2}))?)?$/.exec(words);
    if (!day || !words) return null;
    const number = day[1] ? Number(day[1]) : this.day(nearUs);
    const [hours, minutes, seconds] = [day[2], day[3], day[4]].map((part) => Number(part ?? 0));
    if (hours! > 23 || minutes! > 59 || seconds! > 59) return null;
    const us = ((hours! * 60 + minutes!) * 60 + seconds!) * 1e6;
    return this.inside(this.moment(this.localDayStart(number) + us));
  }

  /** The moment of a day and month: in a year, or in the first year in which the run has it. */
  private ofDate(day: number, name: string, year: string | undefined, time: string): number | null {
    const month = MONTHS.findIndex((each) => each.toLowerCase() === name) + 1;
    const years = year ? [Number(year)] : [this.date(0).getUTCFullYear(), this.date(this.endUs).getUTCFullYear()];
    for (const each of month ? years : []) {
      const found = this.parse(`${each}-${two(month)}-${two(day)}T${time}`);
      if (found !== null) return found;
    }
    return null;
  }

  private inside(us: number): number | null {
    return us >= 0 && us <= this.endUs ? us : null;
  }
}

/** A duration in few words: "3 h 20 min". */
export function durationText(us: number): string {
  const seconds = Math.round(us / 1e6);
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
  if (seconds < 86_400) {
    return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
  }
  return `${Math.floor(seconds / 86_400)} d ${Math.floor((seconds % 86_400) / 3600)} h`;
}

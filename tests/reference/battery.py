"""The charge of a battery along a track, rate by rate, in slow and obvious Python."""


def rates_of(track, battery):
    """Return the moments [us] from that of the battery on at which its rate changes, and the rates."""
    columns = (column.tolist() for column in (track.time, track.x, track.y, track.heading))
    rows = list(zip(*columns, strict=True))
    if not rows:
        return [(battery.since_us, battery.driving)]
    pieces = []
    for i, (time, x, y, heading) in enumerate(rows):
        next_time, *pose = rows[i + 1] if i + 1 < len(rows) else (None, x, y, heading)
        if next_time is not None and next_time <= battery.since_us:
            continue
        rate = battery.standing if pose == [x, y, heading] else battery.driving
        at_charger = (x, y) == (battery.charger_x, battery.charger_y) and pose[:2] == [x, y]
        if at_charger and not battery.is_broken:
            rate = battery.charging
        pieces.append((max(time, battery.since_us), rate))
    return pieces


def levels_of(track, battery):
    """Return when the rate changes, the charge then, and the rate."""
    pieces, level = [], battery.level
    begins = rates_of(track, battery)
    for (begin, rate), (end, _) in zip(begins, [*begins[1:], (None, 0)], strict=True):
        pieces.append((begin, level, rate))
        if end is not None:
            level = min(1.0, max(0.0, level + rate * (end - begin)))
    return pieces


def charge_at(track, battery, moment):
    """Return the charge at a moment."""
    pieces = levels_of(track, battery)
    begin, level, rate = [piece for piece in pieces if piece[0] <= moment][-1]
    return min(1.0, max(0.0, level + rate * (moment - begin)))


def falls_to(track, battery, level):
    """Return the first moment at which the charge is at a level or below."""
    pieces = levels_of(track, battery)
    for (begin, charge, rate), (end, *_) in zip(pieces, [*pieces[1:], (None,)], strict=True):
        if charge <= level:
            return begin
        if rate < 0 and (end is None or charge + rate * (end - begin) <= level):
            return begin + int((charge - level) / -rate) + 1
    return None

"""Numbers as a person reads them."""


def thousands(largest: float) -> tuple[float, str]:
    """Scale and prefix that keep a force readable: 884000 → (1000, "k")."""
    return next(((s, p) for s, p in ((1e6, "M"), (1e3, "k")) if abs(largest) >= 1.5 * s), (1.0, ""))


def duration(seconds: float) -> str:
    """Seconds as "12.3 s", "4 min 5 s" or "2 h 10 min"."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes} min {seconds} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"

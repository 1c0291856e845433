"""What the paper reports, on the real EV-IMO and with its own networks: never in a column with our numbers."""

from dataclasses import dataclass

ON = "as printed in the paper: measured on the real EV-IMO recordings with the paper's own networks"


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One of the paper's tables of results. lines: each the scene, the method, and a text for each head."""

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]


MOTION = PaperTable(
    "Table II: segmentation and motion estimation",
    ("Cam AEE m/s", "Cam RRE rad/s", "Obj AEE m/s", "IoU"),
    (
        ("table", "2 M parameters", "0.07", "0.05", "0.19", "0.83"),
        ("table", "40 k parameters", "0.09", "0.08", "–", "0.63"),
        ("plain wall", "2 M parameters", "0.17", "0.16", "0.38", "0.75"),
        ("plain wall", "40 k parameters", "0.23", "0.24", "–", "0.58"),
        ("fast motion", "2 M parameters", "0.23", "0.20", "0.43", "0.73"),
        ("fast motion", "40 k parameters", "0.28", "0.26", "–", "0.59"),
    ),
)
CLASSIC = PaperTable(
    "Table III: comparison with a four-parameter method",
    ("AEE m/s", "RRE rad/s"),
    (
        ("plain wall, no objects", "EV-IMO", "0.024", "0.095"),
        ("plain wall, no objects", "Classical", "0.031", "0.134"),
    ),
)
DEPTH = PaperTable(
    "Table IV: depth estimation",
    ("Abs Rel", "RMSE log", "SILog", "δ<1.25", "δ<1.25²", "δ<1.25³"),
    (
        ("plain wall", "baseline, 2 M", "0.16", "0.26", "0.07", "0.87", "0.95", "0.97"),
        ("plain wall", "40 k", "0.24", "0.33", "0.11", "0.75", "0.90", "0.95"),
        ("plain wall", "ECN", "0.67", "0.59", "0.33", "0.27", "0.52", "0.80"),
        ("cube background", "baseline, 2 M", "0.13", "0.20", "0.04", "0.87", "0.97", "0.99"),
        ("cube background", "40 k", "0.20", "0.26", "0.07", "0.77", "0.92", "0.97"),
        ("cube background", "ECN", "0.60", "0.56", "0.30", "0.29", "0.53", "0.78"),
        ("table background", "baseline, 2 M", "0.31", "0.32", "0.12", "0.74", "0.90", "0.95"),
        ("table background", "40 k", "0.33", "0.34", "0.15", "0.65", "0.87", "0.95"),
        ("table background", "ECN", "0.47", "0.48", "0.23", "0.45", "0.69", "0.86"),
    ),
)

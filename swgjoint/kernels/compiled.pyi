from swgjoint.typing import Array, Index, Mask

class Limits:
    def __init__(
        self,
        *,
        corner: float,
        beyond: float,
        past: float,
        refined: float,
        refinements: float,
    ) -> None: ...

class Flank:
    def __init__(
        self,
        pieces: Array,
        edges: Array,
        intervals: Index,
        stations: Array,
        coefficients: Array,
        side: float,
    ) -> None: ...

class Search:
    def __init__(
        self,
        flexspline: Flank,
        breaks: Array,
        weights: Array,
        low: float,
        high: float,
        circular_spline: Flank,
        radii: Array,
        stations: Array,
        circular_breaks: Array,
        circular_weights: Array,
        displaced: Array,
        teeth: int,
        teeth_in_model: int,
        angle: Array,
        bearing: Array,
        limits: Limits,
    ) -> None: ...
    def see(
        self,
        points: Array,
        outward: Array,
        sector: Index,
        side: Index,
        rigid: bool,
        start: Array | None,
        steps: int,
        real: Array,
        corner: Mask,
        tooth: Index,
    ) -> None: ...
    def minima(
        self,
        flank: Array,
        searched: Mask,
        coarse: int,
        dense: int,
        limit: float,
        radius: float,
    ) -> tuple[Index, Index, Array]: ...
    def meet(
        self,
        flank: Array,
        sector: Index,
        side: Index,
        station: Array,
        real: Array,
        tooth: Index,
        weight: Array,
        circular_weight: Array,
        sliding: Array,
        circular_sliding: Array,
    ) -> None: ...
    def refine(
        self,
        station: Array,
        mirrored: Array,
        sector: Index,
        side: Index,
        spacing: float,
    ) -> None: ...

class Bore:
    def __init__(self, weights: Array, stations: int) -> None: ...
    def gaps(
        self,
        nodes: Array,
        touching: Mask,
        outline: Array,
        angle: float,
        offset: Array,
        far: float,
        gap: Array,
        normal: Array,
        curvature: Array,
    ) -> None: ...
    def forces(
        self,
        spring: Array,
        gap: Array,
        normal: Array,
        curvature: Array | None,
        into: Index,
        sign: Array | None,
        gradient: Array,
        tangent: Array | None,
    ) -> None: ...
    def gaps_after(
        self, gap: Array, normal: Array, into: Index, increment: Array, result: Array
    ) -> None: ...

class Sector:
    def __init__(
        self,
        skeleton: Array,
        face: int,
        stiffness: Array,
        turning_parts: Array,
        rim_slopes: Array,
        elongation: Array,
        flank_from_skeleton: Array,
        flank_compliance: Array,
    ) -> None: ...
    def tangents(
        self,
        place: Array,
        positions: Array,
        force: Array,
        dofs: Index,
        angle: Array,
        gyration: Array,
        kinematics: Array,
        flank: Array,
        gradient: Array,
        tangent: Array | None,
    ) -> None: ...

class StripProblems:
    def __init__(
        self,
        columns: Array,
        strip_columns: Array,
        strip: Index,
        closed: Mask,
        force_unit: Array,
        direction: Array,
        by_value: Array,
        by_strip: Array,
        slope: Array,
        offset: Array,
        law: Array,
    ) -> None: ...
    def solve(
        self,
        offset: Array,
        tolerance: Array,
        tolerance_m: float,
        tries: int,
        singles: int,
        before: Index,
        active: Mask,
        result: Array,
        approach: Array,
        slope: Array,
        solved: Mask,
    ) -> int: ...

class RingFactor:
    def __init__(self, sectors: int, size: int, face: int) -> None: ...
    def update(self, blocks: Array, changed: Index) -> bool: ...
    def solve(self, loads: Array) -> None: ...
    def condense(
        self, loads: Array, sector: Index, rows: Array, result: Array
    ) -> None: ...
    def solve_contacts(
        self,
        loads: Array,
        sector: Index,
        rows: Array,
        gap: Array,
        arm: Array,
        compliance: Array,
        numbers: Array,
        turns: bool,
        held: bool,
        active: Mask,
        result: Array,
        increment: Array,
    ) -> float: ...

def nearest_tree(distance: Array, order: Index, before: Index) -> None: ...
def outline_distance(points: Array, outline: Array, result: Array) -> None: ...
def grow_oscillation(
    sin: Array,
    cos: Array,
    weight: Array,
    omega: Array,
    offset: float,
    ramp: Array,
    slope: Array,
    bend: Array,
    result: Array,
) -> None: ...
def move_back(time: Array, there: Array, back: Array, result: Array) -> None: ...
def write_plan(
    position: Array,
    velocity: Array,
    acceleration: Array,
    load: float,
    ramp: Array,
    inertia: float,
    result: Array,
) -> None: ...
def race_contact(
    places: Array,
    press: Array,
    half_thickness: float,
    per_sector: int,
    q: Array,
    points: Array,
    touching: Mask,
    gap: Array,
    normal: Array,
    rows: Array,
    gradient: Array,
    hessian: Array,
) -> None: ...
def add_station_stiffness(
    weights: Array, direction: Array, stiffness: Array, result: Array
) -> None: ...
def add_contact_tangents(
    carried: Array,
    angle: Array,
    spin: Array,
    position: Array,
    sector: Index,
    side: Index,
    weights: Array,
    normal: Array,
    numbers: Array,
    force: Array,
    dofs: Index,
    tangent: Array,
) -> None: ...
def add_blocks(blocks: Array, into: Index, result: Array) -> None: ...
def respond(offsets: Index, blocks: Array, force: Array, result: Array) -> None: ...
def follow_path(
    matrix: Array,
    slack: Array,
    by_torque: Array,
    by_value: Array,
    reach: float,
    most: int,
) -> list[tuple[int, float, float]] | None: ...
def contact_compliance(
    block_of: Index,
    after: Index,
    blocks: Array,
    tooth: Index,
    weight: Array,
    result: Array,
) -> None: ...
def add_banded(rows: Index, parts: Array, columns: Array) -> None: ...
def solve_banded(columns: Array, loads: Array) -> bool: ...
def ring_forces(
    step: float,
    stiffness: Array,
    shapes: Array,
    derivatives: Array,
    hoop: Array,
    moment: Array,
    turning: Array,
    gradient: Array,
    hessian: Array,
) -> None: ...
def face_ring(
    q: Array,
    points: Array,
    start: Array,
    own: Index,
    inside: bool,
    place: Array,
    element: Index,
    distance: Array,
    normal: Array,
    tangent: Array,
    by_ring: Array,
    curvature: Array,
) -> None: ...

//! Names of the effects and of the disturbances of a plant.

/// Names of the effects of a plant, in the order of the chain.
pub const EFFECTS: [&str; 11] = [
    "delay",
    "lag",
    "asymmetry",
    "rate-dependence",
    "temperature",
    "creep",
    "load",
    "resonance",
    "saturation",
    "drift",
    "interference",
];

/// Kinds of disturbance for [`PlantConfig::disturbed`](crate::PlantConfig::disturbed).
///
/// They are those of the section `[[disturbance]]`, and a load and a temperature that act but are not recorded.
pub const DISTURBANCES: [&str; 8] =
    ["jump", "gain-step", "bursts", "wander", "slip", "slew-limit", "hidden-load", "hidden-temperature"];

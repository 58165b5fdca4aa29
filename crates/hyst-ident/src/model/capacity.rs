//! Capacities of the operators and chains of the host. Firmware chooses its own capacities.

/// Play operators of a Prandtl-Ishlinskii model, elements of a Maxwell-slip model.
pub const PLAYS: usize = 64;
/// Nodes along one edge of a Preisach triangle.
pub const NODES: usize = 65;
/// Nodes along one edge of a mirror grid.
pub const MIRROR: usize = 32;
/// Samples of a delay.
pub const DELAY: usize = 8192;
/// Elements of a creep bank.
pub const CREEP: usize = 32;
/// Taps of one preview filter.
pub const TAPS: usize = 4095;
/// References of one anti-causal inverse.
pub const REFERENCES: usize = 8192;

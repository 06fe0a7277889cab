//! What the experiment with an extended target assumes.

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each cell.
pub const RUNS: usize = 100;
/// Runs of each cell of the short version.
pub const QUICK_RUNS: usize = 20;
/// Lengths of a recording, one scan a second; the paper's is the first.
pub const SCANS: [usize; 3] = [10, 50, 100];
/// Points of the target in a scan: the text's "nine". Read as nine for each of the three ellipses, it is the other.
pub const RATE: usize = 9;
/// The other reading of the rate.
pub const OTHER_RATE: usize = 27;
/// Lengths at which the other rate is computed.
pub const OTHER_RATE_SCANS: [usize; 2] = [10, 50];
/// Points of clutter in a scan; the paper has none.
pub const CLUTTER: [usize; 2] = [1, 3];
/// Length at which clutter is computed.
pub const CLUTTER_SCANS: usize = 50;
/// Side of the square about the target that clutter falls into, m.
pub const CLUTTER_SIDE: f64 = 60.0;
/// Particles of methods that have them: the paper's.
pub const PARTICLES: usize = 1000;

/// First state: place in m, velocity in m/s. The paper does not print the velocity.
pub const FIRST_STATE: [f64; 4] = [0.0, 0.0, 10.0, 0.0];
/// Variance of what methods know of it, in each component.
pub const FIRST_VARIANCE: f64 = 0.01;
/// Spectral density of the acceleration's white noise: the paper's Q.
pub const ACCELERATION: f64 = 1.0;

/// The true shape: offset from the centre, m, and extent (xx, xy, yy), m^2, of each ellipse; weights are equal, and
/// methods know that they are.
pub const TRUTH: [([f64; 2], [f64; 3]); 3] =
    [([0.0, 0.0], [50.0, 0.0, 2.0]), ([0.0, -5.0], [8.0, 4.5, 5.0]), ([0.0, 5.0], [8.0, -4.5, 5.0])];
/// The start `near`: the paper's, read off its figure 3.
pub const NEAR: [([f64; 2], [f64; 3]); 3] =
    [([0.0, 0.0], [15.0, 0.0, 15.0]), ([0.0, -3.0], [15.0, 0.0, 15.0]), ([0.0, 3.0], [15.0, 0.0, 15.0])];
/// Scans that the start `data` is made from, as far as the recording has them, ...
pub const DATA_SCANS: usize = 10;
/// ... the number of times that it is tried, the most likely being kept, ...
pub const DATA_TRIES: u64 = 6;
/// ... and the variance of the single ellipse that it begins with, m^2.
pub const DATA_VARIANCE: f64 = 20.0;

/// Standard deviations at which outlines are drawn and compared.
pub const OUTLINE: f64 = 2.0;
/// A run has failed where its last outline overlaps the true one by less than this, ...
pub const FAILED_IOU: f64 = 0.6;
/// ... where the last centroid is further off than this, m, or where the method gave up.
pub const FAILED_CENTROID: f64 = 5.0;

/// `window-vb`: scans in the window, ...
pub const WINDOW: usize = 10;
/// ... turns after each scan, ...
pub const SWEEPS: usize = 5;
/// ... points that the first shape counts for in each ellipse, ...
pub const PRIOR_POINTS: f64 = 1.0;
/// ... and the least eigenvalue of an extent, m^2.
pub const FLOOR: f64 = 0.1;

/// What the comparison on recordings assumes: for all methods the same.
pub mod recorded {
    /// Density of the acceleration's white noise, m^2/s^3: that of an ordinary car. Not searched for.
    pub const ACCELERATION: f64 = 1.0;
    /// Standard deviations of the first place, m, and, of the vehicle, of the first velocity, m/s.
    pub const PLACE_SD: f64 = 2.0;
    /// ...
    pub const SPEED_SD: f64 = 3.0;
    /// First variance of an ellipse along either axis, m^2, ...
    pub const VARIANCE: f64 = 1.5;
    /// ... the points that it counts for with the vehicle, ...
    pub const POINTS_OF_PRIOR: f64 = 0.5;
    /// ... and with objects of the radar, which have few of their own. This and the variance were chosen, by the
    /// overlap of all methods, on scene 0239.
    pub const POINTS_OF_SIZE: f64 = 3.0;
    /// Scans of the vehicle that first shapes are made from; what follows is judged.
    pub const FIRST_SCANS: usize = 10;
    /// Most ellipses that are tried.
    pub const MOST_ELLIPSES: usize = 6;
    /// Least eigenvalue of an extent, m^2: a lidar's points lie within a decimetre of a side.
    pub const FLOOR: f64 = 0.01;
    /// How long random matrices remember, s, and what the window filter keeps from scan to scan, of a tenth of a second:
    /// the same.
    pub const FORGETTING_S: f64 = 1.0;
    /// ...
    pub const KEEP: f64 = 0.9;
    /// Noise of the radar on each point, m.
    pub const SENSOR_SD: f64 = 0.3;
    /// Points that an object must have.
    pub const LEAST_POINTS: usize = 5;
    /// How far beyond its box a point may lie and still be counted for it, m.
    pub const BOX_MARGIN: f64 = 1.0;
    /// Standard deviations at which outlines are compared with boxes.
    pub const OUTLINE: f64 = 2.0;
}

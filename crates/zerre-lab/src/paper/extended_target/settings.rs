//! What the experiment with an extended target assumes.

use zerre::extended::contour::{ContourSettings, Depth, RadiusProcess};
use zerre::math::Matrix;

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
/// Standard deviation of what methods know of it, in each component: as good as all.
pub const FIRST_DEVIATION: f64 = 0.01;
/// Spectral density of the acceleration's white noise: the paper's Q.
pub const ACCELERATION: f64 = 1.0;

/// The true shape: offset from the centre, m, and extent (xx, xy, yy), m^2, of each ellipse; weights are equal, and
/// methods know that they are.
pub const TRUTH: [([f64; 2], [f64; 3]); 3] =
    [([0.0, 0.0], [50.0, 0.0, 2.0]), ([0.0, -5.0], [8.0, 4.5, 5.0]), ([0.0, 5.0], [8.0, -4.5, 5.0])];
/// The start `near`: the paper's, read off its figure 3.
pub const NEAR: [([f64; 2], [f64; 3]); 3] =
    [([0.0, 0.0], [15.0, 0.0, 15.0]), ([0.0, -3.0], [15.0, 0.0, 15.0]), ([0.0, 3.0], [15.0, 0.0, 15.0])];
/// The start `data`: scans that it is made from, as far as the recording has them, ...
pub const DATA_SCANS: usize = 10;
/// ... the number of times that it is tried, the most likely being kept, ...
pub const DATA_TRIES: usize = 6;
/// ... and turns of each.
pub const DATA_TURNS: usize = 40;

/// Standard deviations at which outlines are drawn and compared.
pub const OUTLINE: f64 = 2.0;
/// A run has failed where its last outline overlaps the true one by less than this, ...
pub const FAILED_IOU: f64 = 0.6;
/// ... where the last centroid is further off than this, m, or where the method gave up.
pub const FAILED_CENTROID: f64 = 5.0;

/// Methods that learn ellipses: points that the first shape counts for in each, ...
pub const PRIOR_POINTS: f64 = 1.0;
/// ... and the least eigenvalue of an extent, m^2.
pub const FLOOR: f64 = 0.1;

/// `paper`, `paper-sequential`, `rb-online-em`: scan k counts k to the power of minus this, ...
pub const EXPONENT: f64 = 0.6;
/// ... and the first scans change nothing yet.
pub const BURN_IN: u64 = 3;

/// `window-vb`: scans in the window, ...
pub const WINDOW: usize = 10;
/// ... turns after each scan, ...
pub const SWEEPS: usize = 5;
/// ... scans in the window where clutter is modelled, ...
pub const CLUTTER_WINDOW: usize = 40;
/// ... turns after each scan there: of 20, 30, 40 and 50 scans and of 5, 10 and 20 turns those after which more brings next
/// to nothing, by 800 runs under seed 1001 with 3 points of clutter, ...
pub const CLUTTER_SWEEPS: usize = 10;
/// ... and the scans that a first guess counts for where rates are learnt, which for clutter is one point a scan; .01 and 1
/// do as well, by 200 of these runs.
pub const VAGUE: f64 = 0.1;

/// `batch-vb`: turns.
pub const BATCH_TURNS: usize = 60;
/// `batch-pf`: turns, ...
pub const BATCH_ITERATIONS: usize = 30;
/// ... and paths drawn backwards in each.
pub const BATCH_PATHS: usize = 50;

/// Methods with one ellipse: its first extent is a circle of this variance, m^2, ...
pub const EXTENT_VARIANCE: f64 = 20.0;
/// ... that for random matrices counts as so many degrees of freedom, ...
pub const EXTENT_DOF: f64 = 8.0;
/// ... and for `mem-ekf` is uncertain by these standard deviations in orientation, rad, and semi-axes, m.
pub const AXES_DEVIATIONS: [f64; 3] = [0.5, 2.0, 2.0];
/// `mem-ekf`: least semi-axis, m.
pub const LEAST_AXIS: f64 = 0.3;

/// `star-convex`: the outline at two standard deviations of a circle as above. The filter needs some noise of the sensor,
/// of which there is none.
pub const CONTOUR: ContourSettings = ContourSettings {
    process: RadiusProcess { radius: 8.944, common: 3.0, deviation: 3.0, length: 0.6 },
    forgetting: 0.0,
    noise: Matrix([[0.25, 0.0], [0.0, 0.25]]),
    depth: Depth::NORMAL,
};
/// Corners of its outline.
pub const CONTOUR_CORNERS: usize = 72;

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

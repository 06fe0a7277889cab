//! What a tracker by appearance assumes, and the five presets of the paper.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use zerre::resample::{Resampling, Trigger};

/// Settings of an [`AppearanceTracker`](super::AppearanceTracker). The presets hold what the paper says;
/// where it says nothing they hold a reading, which the fields name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct AppearanceSettings {
    /// What makes a box resemble the object.
    pub similarity: Similarity,
    /// Side of the Gaussian kernel that smooths the frame first, odd; `None`: not smoothed. The paper names
    /// no size; 5 is the reading.
    pub blur: Option<usize>,
    /// Adaptive equalisation of the grey frame after that; `None`: the grey values as they are.
    pub equalisation: Option<Equalisation>,
    /// What becomes of the template after the first frame. The paper takes it from the first frame and
    /// mentions no update, so it stays as it is.
    pub template: TemplateUpdate,
    /// Number of particles; the paper's is 70.
    pub particles: usize,
    /// sigma of the likelihood N(D; 0, sigma^2) of equation 17; the paper's is 0.01.
    pub sigma: f64,
    /// What optical flow does to the particles. The paper uses it "for the velocity of the particles" in the
    /// section on the structural trackers, so the colour trackers go without.
    pub flow: FlowUse,
    /// Share of its velocity that a particle keeps from frame to frame: A of equation 15. The paper gives no
    /// A; 1 (constant velocity) is the reading, 0 is a random walk.
    pub velocity_kept: f64,
    /// Standard deviation that a frame adds to each coordinate of the centre. The paper gives none; a tenth
    /// of the box's side is the reading.
    pub position_noise: Deviation,
    /// Standard deviation that a frame adds to each component of the velocity, pixels per frame; 1 is the
    /// reading.
    pub velocity_noise: f64,
    /// Standard deviation that a frame adds to the logarithm of the width and of the height. The paper's
    /// state has them, but its trackers never change them: 0, a box of fixed size, is the reading.
    pub size_noise: f64,
    /// How survivors are drawn; the paper does not say.
    pub resampling: Resampling,
    /// When they are drawn; the paper does so in every frame.
    pub trigger: Trigger,
}

/// How a box is compared with the template.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Similarity {
    /// The Bhattacharyya coefficient of colour histograms (equations 18 and 19).
    Colour {
        /// Bins of each of red, green and blue; the paper's are 8.
        bins: usize,
        /// Whether D is sqrt(1 - BC), a metric and what OpenCV computes, instead of 1 - BC as the paper
        /// prints.
        root: bool,
    },
    /// Mean structural similarity of the grey values (equations 10 and 14).
    Structure {
        /// Side of the square of equal weights over which local means are taken, pixels; at most the box's
        /// shorter side. 7 is the reading.
        window: usize,
        /// alpha, beta and gamma of equation 10, the powers of luminance, contrast and structure. With 1, 1,
        /// 1 it is equation 14. A negative structure keeps its sign under any power.
        exponents: [f64; 3],
        /// How the middle of the box counts more than its border.
        centre: CentreWeight,
    },
}

/// How the middle of a box counts more than its border: by a Gaussian as wide as the box, with OpenCV's
/// standard deviation for its size, 0.3 ((side - 1) / 2 - 1) + 0.8, and 1 in the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CentreWeight {
    /// It does not.
    #[default]
    None,
    /// Both patches are multiplied by the Gaussian before they are compared, as the paper says. Where both
    /// are nearly black they are alike, which brings D near to 0 for every box.
    Multiplied,
    /// The mean over the map of similarity is weighted instead.
    Map,
}

/// Contrast-limited adaptive histogram equalisation of the whole frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Equalisation {
    /// How many times the mean count a bin may hold. 2 is the reading.
    pub clip: f64,
    /// Columns and rows of tiles. 8 x 8 is the reading.
    pub tiles: (usize, usize),
}

impl Default for Equalisation {
    fn default() -> Self {
        Equalisation { clip: 2.0, tiles: (8, 8) }
    }
}

/// What becomes of the template.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TemplateUpdate {
    /// It stays that of the first frame.
    #[default]
    Fixed,
    /// After each frame it is (1 - rate) of itself and `rate` of what the estimated box shows.
    Blended {
        /// From 0 to 1.
        rate: f64,
    },
}

/// What the median Lucas-Kanade flow of the last box does. Where none is found, a frame goes by without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FlowUse {
    /// Nothing: no flow is computed.
    #[default]
    Off,
    /// It takes the place of every particle's velocity, and the particle moves by it.
    Velocity,
    /// It moves every particle beside the particle's own velocity, which then is what the flow leaves over.
    Move,
}

/// A standard deviation of positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Deviation {
    /// Pixels.
    Pixels(f64),
    /// A share of the side of the square with the first box's area.
    BoxShare(f64),
}

impl Deviation {
    /// It in pixels, for a box of this size.
    pub fn pixels(self, width: f64, height: f64) -> f64 {
        match self {
            Deviation::Pixels(sd) => sd,
            Deviation::BoxShare(share) => share * (width * height).sqrt(),
        }
    }
}

impl AppearanceSettings {
    /// RT: colour histograms.
    pub fn rt() -> Self {
        AppearanceSettings {
            similarity: Similarity::Colour { bins: 8, root: false },
            blur: None,
            equalisation: None,
            template: TemplateUpdate::Fixed,
            particles: 70,
            sigma: 0.01,
            flow: FlowUse::Off,
            velocity_kept: 1.0,
            position_noise: Deviation::BoxShare(0.1),
            velocity_noise: 1.0,
            size_noise: 0.0,
            resampling: Resampling::Systematic,
            trigger: Trigger::Always,
        }
    }

    /// FRT: colour histograms of the smoothed frame.
    pub fn frt() -> Self {
        AppearanceSettings { blur: Some(5), ..AppearanceSettings::rt() }
    }

    /// SSIM: structural similarity of grey values, and the flow as velocity.
    pub fn ssim() -> Self {
        let similarity = Similarity::Structure { window: 7, exponents: [1.0; 3], centre: CentreWeight::None };
        AppearanceSettings { similarity, flow: FlowUse::Velocity, ..AppearanceSettings::rt() }
    }

    /// SSIMFAHE: structural similarity of the smoothed and equalised frame.
    pub fn ssimfahe() -> Self {
        AppearanceSettings {
            blur: Some(5),
            equalisation: Some(Equalisation::default()),
            ..AppearanceSettings::ssim()
        }
    }

    /// MASSIMAHE: the same with patches that are weighted towards their middle.
    pub fn massimahe() -> Self {
        let similarity =
            Similarity::Structure { window: 7, exponents: [1.0; 3], centre: CentreWeight::Multiplied };
        AppearanceSettings { similarity, ..AppearanceSettings::ssimfahe() }
    }

    /// # Errors
    /// A number out of its range.
    pub(super) fn checked(&self) -> Result<()> {
        let refuse = |what, value, needs| Err(Error::OutOfRange { what, value, needs });
        if let Some(side) = self.blur
            && (side % 2 == 0 || side > 101)
        {
            return refuse(
                "side of the kernel that smooths",
                side as f64,
                "an odd number up to 101 is needed",
            );
        }
        if let Some(Equalisation { clip, tiles: (columns, rows) }) = self.equalisation {
            if !(clip.is_finite() && clip >= 0.0) {
                return refuse("clip limit of the equalisation", clip, "it must not be negative");
            }
            if columns.min(rows) == 0 || columns.max(rows) > 64 {
                let needs = "from 1 to 64 columns and rows are needed";
                return refuse("tiles of the equalisation", columns.min(rows) as f64, needs);
            }
        }
        match self.similarity {
            Similarity::Colour { bins, .. } if !(1..=32).contains(&bins) => {
                return refuse("bins of a colour", bins as f64, "from 1 to 32 are needed");
            }
            Similarity::Structure { window, .. } if window < 2 => {
                return refuse("side of the window", window as f64, "at least 2 pixels are needed");
            }
            Similarity::Structure { exponents, .. } => {
                let is_bad = |e: &f64| !(e.is_finite() && *e >= 0.0);
                if let Some(&bad) = exponents.iter().find(|e| is_bad(e)) {
                    return refuse("exponent of the similarity", bad, "it must not be negative");
                }
            }
            Similarity::Colour { .. } => {}
        }
        if let TemplateUpdate::Blended { rate } = self.template
            && !(0.0..=1.0).contains(&rate)
        {
            return refuse("rate of the template", rate, "it must lie from 0 to 1");
        }
        if !(self.sigma.is_finite() && self.sigma >= 1e-6) {
            return refuse("sigma of the likelihood", self.sigma, "it must be 1e-6 or more");
        }
        let (Deviation::Pixels(position) | Deviation::BoxShare(position)) = self.position_noise;
        let sds = [
            ("noise of the position", position),
            ("noise of the velocity", self.velocity_noise),
            ("noise of the size", self.size_noise),
        ];
        if let Some(&(what, value)) = sds.iter().find(|(_, sd)| !(sd.is_finite() && *sd >= 0.0)) {
            return refuse(what, value, "it must not be negative");
        }
        if !(-1.0..=1.0).contains(&self.velocity_kept) {
            return refuse(
                "share of the velocity that is kept",
                self.velocity_kept,
                "it must lie from -1 to 1",
            );
        }
        Ok(())
    }
}

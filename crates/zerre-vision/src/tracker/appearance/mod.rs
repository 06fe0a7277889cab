//! Particle filters that look for a box which resembles a template: Dilmen and Talu, *A particle filter that
//! uses structural similarity for tracking*, 2017. The paper's five trackers are settings of one: RT and FRT
//! compare colour histograms, SSIM, SSIMFAHE and MASSIMAHE grey values.
//!
//! Each particle is a box with a velocity. It moves by a first-order autoregression, which optical flow may
//! lead, and is weighed by N(D; 0, sigma^2), D being one less its similarity with the template. With the
//! paper's sigma of 0.01 that underflows for almost every box of a real frame: weights are logarithms here,
//! and the sum is never zero.

mod colour;
mod flow;
mod motion;
mod place;
mod resemblance;
mod settings;
mod structure;

pub use settings::{
    AppearanceSettings, CentreWeight, Deviation, Equalisation, FlowUse, Similarity, TemplateUpdate,
};

use super::{Estimate, Particle, Tracker};
use crate::{Error, Frame, Rect, Result};
use flow::Trail;
use motion::{BoxMotion, STATE};
use place::Place;
use resemblance::{Resemblance, Spare, Template};
use zerre::Time;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::kernels::Threads;
use zerre::rng::Stream;

/// Frames whose mean score is what the object usually reaches.
const USUAL_FRAMES: u32 = 10;

/// A particle filter whose likelihood is the similarity with a template.
///
/// The score is that of the estimated box: the Bhattacharyya coefficient or the mean structural similarity.
///
/// The paper knows no object that is lost. [`Estimate::p_lost`] is a rule here and no calibrated probability:
/// 0 where the score is what it was on average in the first ten frames, 1 where it is what the eight boxes
/// around the object scored in the first frame, and straight in between.
#[derive(Debug)]
pub struct AppearanceTracker {
    settings: AppearanceSettings,
    filter: Settings,
    /// Standard deviation of the position's noise, pixels.
    position_sd: f64,
    prior: Gaussian<STATE>,
    cloud: Cloud<STATE>,
    template: Template,
    spare: Spare,
    /// Corners of the last box, where flow is used.
    trail: Option<Trail>,
    size: (usize, usize),
    /// Frames since the first.
    steps: i64,
    /// Sum and number of the first scores, beginning with that of the template itself.
    usual: (f64, u32),
    /// Score of what surrounded the object.
    ground: f64,
}

impl AppearanceTracker {
    /// A tracker of what is in `bounds` on `frame`. One stream gives the same answers for any number of
    /// threads.
    ///
    /// # Errors
    /// A setting out of its range; a box of less than 2 x 2 pixels, one that is larger than the frame, or one
    /// with its centre beyond the frame.
    pub fn start(
        frame: &Frame,
        bounds: Rect,
        settings: &AppearanceSettings,
        (stream, threads): (Stream, Threads),
    ) -> Result<AppearanceTracker> {
        settings.checked()?;
        let bounds = bounds.on_frame(frame.size())?;
        let [x, y] = bounds.centre();
        let state = [x, y, 0.0, 0.0, bounds.width, bounds.height];
        let Some(place) = Place::of(state, frame.size()) else {
            let (width, height) = frame.size();
            let problem = format!(
                "has its centre outside the frame of {width} x {height} pixels, or is larger than it: draw it about \
                 what is seen of the object"
            );
            return Err(Error::Bounds { bounds, problem });
        };
        // The first particles are the first box, which is known.
        let prior = Gaussian::independent(state, [0.0; STATE])?;
        let filter = Settings {
            particles: settings.particles,
            resampling: settings.resampling,
            trigger: settings.trigger,
            threads,
            ..Settings::default()
        };
        let spare = Spare::default();
        let template = Template::new(frame, place, settings)?;
        let position_sd = settings.position_noise.pixels(bounds.width, bounds.height);
        let resemblance = Resemblance::new(&template, settings, &spare, 0);
        let around: Vec<f64> = [-1.0, 0.0, 1.0]
            .iter()
            .flat_map(|dx| [-1.0, 0.0, 1.0].map(|dy| [*dx, dy]))
            .filter(|shift| *shift != [0.0, 0.0])
            .filter_map(|[dx, dy]| {
                let there = [x + dx * bounds.width, y + dy * bounds.height, 0.0, 0.0, state[4], state[5]];
                Place::of(there, frame.size()).map(|place| resemblance.similarity(frame, place))
            })
            .collect::<Result<_>>()?;
        let ground = around.iter().sum::<f64>() / around.len().max(1) as f64;
        let usual = (resemblance.similarity(frame, place)?, 1);
        let motion = BoxMotion::new(settings, position_sd, None, frame.size());
        let rules = ParticleFilter::new(prior, motion, resemblance, filter.clone())?;
        let cloud = rules.start(Time::ZERO, stream)?;
        Ok(AppearanceTracker {
            settings: settings.clone(),
            filter,
            position_sd,
            prior,
            cloud,
            template,
            spare,
            trail: trail(frame, Some(place), settings)?,
            size: frame.size(),
            steps: 0,
            usual,
            ground,
        })
    }

    /// The rule of [`Estimate::p_lost`].
    fn p_lost(&mut self, score: f64) -> f64 {
        if self.usual.1 < USUAL_FRAMES {
            self.usual = (self.usual.0 + score, self.usual.1 + 1);
        }
        let usual = self.usual.0 / f64::from(self.usual.1);
        if usual > self.ground { ((usual - score) / (usual - self.ground)).clamp(0.0, 1.0) } else { 0.5 }
    }
}

/// Corners of the estimated box, where there is one and flow is used.
fn trail(frame: &Frame, place: Option<Place>, settings: &AppearanceSettings) -> Result<Option<Trail>> {
    let place = place.filter(|_| settings.flow != FlowUse::Off);
    place.map(|place| Trail::new(frame, place)).transpose()
}

impl Tracker for AppearanceTracker {
    fn step(&mut self, frame: &Frame) -> Result<Estimate> {
        if frame.size() != self.size {
            return Err(Error::Size { found: frame.size(), expected: self.size });
        }
        let flow = self.trail.as_ref().map(|trail| trail.median(frame)).transpose()?.flatten();
        self.steps += 1;
        let motion = BoxMotion::new(&self.settings, self.position_sd, flow, self.size);
        let resemblance = Resemblance::new(&self.template, &self.settings, &self.spare, self.steps);
        let rules = ParticleFilter::new(self.prior, motion, resemblance, self.filter.clone())?;
        rules.step(&mut self.cloud, Time::from_nanos(self.steps * 1_000_000_000), Some(frame))?;
        let law = self.cloud.gaussian()?;
        let mut state = *law.mean();
        if self.settings.size_noise == 0.0 {
            // The mean of equal numbers is rounded.
            let [.., width, height] = *self.prior.mean();
            (state[4], state[5]) = (width, height);
        }
        let [x, y, _, _, width, height] = state;
        let place = Place::of(state, self.size);
        let score = match place {
            Some(place) => rules.sensor().similarity(frame, place)?,
            None => 0.0,
        };
        if let (TemplateUpdate::Blended { rate }, Some(place)) = (self.settings.template, place) {
            self.template.blend(frame, place, &self.settings, rate)?;
        }
        self.trail = trail(frame, place, &self.settings)?;
        let covariance = law.covariance().0;
        Ok(Estimate {
            bounds: Rect::about([x, y], width, height),
            covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[i][j])),
            score,
            p_lost: self.p_lost(score),
        })
    }

    fn particles(&self) -> Vec<Particle> {
        if self.steps == 0 {
            return Vec::new();
        }
        let centres = self.cloud.column(0).iter().zip(self.cloud.column(1));
        centres
            .zip(self.cloud.weights())
            .map(|((x, y), weight)| Particle { centre: [*x, *y], weight })
            .collect()
    }
}

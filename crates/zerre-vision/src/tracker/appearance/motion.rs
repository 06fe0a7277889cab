//! How the boxes of particles move.

use super::settings::{AppearanceSettings, FlowUse};
use zerre::math::Real;
use zerre::model::Motion;
use zerre::{Result, Time};

/// Components of the state: x and y of the centre, their velocities u and v, width and height.
pub(super) const STATE: usize = 6;

/// x_k = A x_{k-1} + noise (Dilmen and Talu 2017, equation 15), once per frame: the centre moves by the
/// velocity, which keeps its share, and the logarithms of the sides wander. The flow of the frame enters as
/// the settings say. Centres stay on the frame, beyond which nothing can be seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxMotion {
    /// What stands in for every velocity.
    velocity: Option<[f64; 2]>,
    /// What moves every centre beside its velocity.
    shift: [f64; 2],
    kept: f64,
    position_sd: f64,
    velocity_sd: f64,
    size_sd: f64,
    /// Width and height of the frame.
    size: [f64; 2],
}

impl BoxMotion {
    /// The motion of one frame with this flow, pixels; `position_sd` in pixels, `size` of the frame.
    pub(super) fn new(
        settings: &AppearanceSettings,
        position_sd: f64,
        flow: Option<[f64; 2]>,
        (width, height): (usize, usize),
    ) -> BoxMotion {
        BoxMotion {
            velocity: flow.filter(|_| settings.flow == FlowUse::Velocity),
            shift: flow.filter(|_| settings.flow == FlowUse::Move).unwrap_or_default(),
            kept: settings.velocity_kept,
            position_sd,
            velocity_sd: settings.velocity_noise,
            size_sd: settings.size_noise,
            size: [width as f64, height as f64],
        }
    }
}

impl Motion<STATE, STATE> for BoxMotion {
    type Step = BoxMotion;

    fn over(&self, _: Time, _: Time) -> Result<BoxMotion> {
        Ok(*self)
    }

    #[inline(always)]
    fn apply<R: Real>(step: &BoxMotion, x: [R; STATE], noise: [R; STATE]) -> [R; STATE] {
        let mut moved = x;
        for d in 0..2 {
            let velocity = match step.velocity {
                Some(flow) => x[2 + d].constant(flow[d]),
                None => x[2 + d],
            };
            let free = x[d] + velocity + step.shift[d] + noise[d] * step.position_sd;
            moved[d] = free.max(free.constant(0.0)).min(free.constant(step.size[d]));
            moved[2 + d] = velocity * step.kept + noise[2 + d] * step.velocity_sd;
        }
        if step.size_sd > 0.0 {
            for d in 4..6 {
                moved[d] = x[d] * (noise[d] * step.size_sd).exp();
            }
        }
        moved
    }

    fn noise_components(&self) -> usize {
        if self.size_sd > 0.0 { 6 } else { 4 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATE_BEFORE: [f64; STATE] = [10.0, 20.0, 1.5, -2.0, 8.0, 6.0];

    fn moved(settings: &AppearanceSettings, noise: [f64; STATE]) -> [f64; STATE] {
        let motion = BoxMotion::new(settings, 3.0, Some([4.0, 5.0]), (100, 22));
        let step = motion.over(Time::ZERO, Time::from_secs(1.0)).unwrap();
        BoxMotion::apply(&step, STATE_BEFORE, noise)
    }

    #[test]
    fn flow_is_a_velocity_or_a_move() {
        let rt = AppearanceSettings::rt();
        let with = |flow| moved(&AppearanceSettings { flow, ..rt.clone() }, [0.0; STATE]);
        assert_eq!(with(FlowUse::Off), [11.5, 18.0, 1.5, -2.0, 8.0, 6.0]);
        assert_eq!(with(FlowUse::Velocity), [14.0, 22.0, 4.0, 5.0, 8.0, 6.0]);
        assert_eq!(with(FlowUse::Move), [15.5, 22.0, 1.5, -2.0, 8.0, 6.0]);
    }

    #[test]
    fn noise_has_the_sizes_of_the_settings() {
        let still = AppearanceSettings { velocity_kept: 0.5, ..AppearanceSettings::rt() };
        assert_eq!(moved(&still, [1.0; STATE]), [14.5, 21.0, 1.75, 0.0, 8.0, 6.0]);
        let growing = AppearanceSettings { size_noise: 0.1, ..still };
        let [.., width, height] = moved(&growing, [1.0, 1.0, 1.0, 1.0, 1.0, -1.0]);
        assert!(
            (width - 8.0 * 0.1_f64.exp()).abs() < 1e-12 && (height - 6.0 * (-0.1_f64).exp()).abs() < 1e-12
        );
    }
}

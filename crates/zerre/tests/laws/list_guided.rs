//! Particle filters that look at the measurement before they move, and such as keep their particles apart,
//! for the list.

use crate::list::{Class, Entry, Means, Sensor, World, entry};
use zerre::filter::{Kernel, Linear, ParticleFilter, Rejuvenation, Settings, SigmaPoints, Tangent};
use zerre::proposal::Guided;
use zerre::resample::{Resampling, Trigger};

pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let Means { particles, simd, ref threads } = *means;
    let plain = Settings { particles, simd, threads: threads.clone(), ..Settings::default() };
    let always = Settings { trigger: Trigger::Always, ..plain.clone() };
    let ahead = |tau| Settings { lookahead: Some(tau), ..plain.clone() };
    let tangent = Guided::<Tangent, 2>::new(Tangent);
    let points = Guided::<SigmaPoints, 2>::new(SigmaPoints::default());
    // Away from the default, where the covariance has another centre.
    let spread = SigmaPoints { alpha: 0.8, beta: 2.0, kappa: None };
    let mut list = Vec::new();
    let mut add = |name: &str, filter| list.push(entry(name, Class::Consistent, filter));

    let guided = |proposal, settings| ParticleFilter::guided(prior, motion, sensor, proposal, settings);
    add("EKF-guided", guided(tangent, plain.clone()).unwrap());
    let never = Settings { trigger: Trigger::Never, ..plain.clone() };
    add("EKF-guided, importance sampling", guided(tangent, never).unwrap());
    add("EKF-guided, defensive", guided(tangent.with_defensive(0.2).unwrap(), always.clone()).unwrap());
    let stratified = Settings { resampling: Resampling::Stratified, ..ahead(0.7) };
    add("EKF-guided, auxiliary", guided(tangent, stratified).unwrap());

    let guided = |proposal, settings| ParticleFilter::guided(prior, motion, sensor, proposal, settings);
    let mut add = |name: &str, filter| list.push(entry(name, Class::Consistent, filter));
    add("UKF-guided", guided(points, plain.clone()).unwrap());
    let points = Guided::<SigmaPoints, 2>::new(spread).with_defensive(0.1).unwrap();
    add("UKF-guided, other points, defensive", guided(points, always.clone()).unwrap());

    // It refuses worlds that are not linear.
    let optimal = Guided::<Linear, 2>::new(Linear);
    let guided = |settings| ParticleFilter::guided(prior, motion, sensor, optimal, settings);
    if let (Ok(plain), Ok(ahead)) = (guided(plain.clone()), guided(ahead(1.0))) {
        list.push(entry("locally optimal", Class::Consistent, plain));
        list.push(entry("locally optimal, fully adapted", Class::Consistent, ahead));
    }

    let mut add = |name: &str, class, settings| {
        list.push(entry(name, class, ParticleFilter::new(prior, motion, sensor, settings).unwrap()));
    };
    add("auxiliary (Pitt and Shephard)", Class::Consistent, ahead(1.0));
    add("auxiliary, tempered", Class::Consistent, ahead(0.5));
    for kernel in [Kernel::Gaussian, Kernel::Epanechnikov] {
        let regularised =
            |shrink| Settings { rejuvenation: Rejuvenation::Regularise { kernel, shrink }, ..always.clone() };
        add(&format!("regularised, {kernel:?}"), Class::Consistent, regularised(true));
        let name = format!("regularised without shrinking, {kernel:?}");
        add(&name, Class::Reproduction, regularised(false));
    }
    list
}

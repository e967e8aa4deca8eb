"""What each error of a set-up costs, what all cost together, and how well each part must be known for 20 nm."""

import sys
from dataclasses import replace
from pathlib import Path

import irtscots_cl as irt

quick = "--quick" in sys.argv
scene = irt.load_scene(Path(__file__).with_name("budget-406.toml"))
budget = replace(scene.budget, trials=32 if quick else 512, allow_nm=20.0)
found = irt.assess_budget(scene, budget)

print("rms height error [nm], piston and tilt removed")
for name, nm in sorted(found.linear.nm.items(), key=lambda item: -item[1][0])[:5]:
    print(f"  {name:26} {nm[0]:8.2f}")
print(f"  all, predicted             {found.linear.total_nm[0]:8.2f}")
print(f"  95 % of the trials below   {found.monte_carlo.percentile_nm(0.95)[0]:8.2f}")
print("to calibrate, the best value first:")
for step in found.tolerances.plan:
    print(f"  {step.name:26} {step.after_nm:8.2f} nm left")

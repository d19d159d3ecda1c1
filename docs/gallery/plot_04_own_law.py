"""
Your own controller in ten lines of Python
==========================================

Any callable can replace the controller: it receives a sample and returns the force. Its reports are recorded. Plant,
noise, metrics and plots stay the same.
"""

import fracgyro as fg


class Learning:
    def reset(self, scenario):
        self.sum = [0.0, 0.0]

    def __call__(self, s):
        errors = [q - r for q, r in zip(s.position, s.reference, strict=True)]
        rates = [v - w for v, w in zip(s.velocity, s.reference_velocity, strict=True)]
        self.sum = [total + 40.0 * e for total, e in zip(self.sum, errors, strict=True)]
        return [-4e4 * e - 300 * de - i for e, de, i in zip(errors, rates, self.sum, strict=True)]

    def report(self):
        return {"integral": self.sum}


run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 10.0}), controller=Learning())
fg.plot(run)
print("largest error of x and y from t = 5 on:", abs(run["error"].sel(time=slice(5, None))).max("time").values)

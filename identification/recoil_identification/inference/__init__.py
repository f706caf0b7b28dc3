"""One inference: unknowns, what is known of them beforehand, what was recorded, and what follows from both.

::

    Unknown    a number that is looked for
    Prior      what certificates, the pre-trigger baseline or a drawing say of some unknowns
    Block      rows of a record that a model explains by some unknowns
    Estimate   values, covariance, sensitivities to every prior, normalised residuals, draws

`recoil_identification.inference.solve.solve` takes blocks and priors and gives the estimate. A method is a list of
blocks; it solves nothing itself.
"""

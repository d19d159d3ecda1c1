classdef Fracgyro < handle
    % Fracgyro  The controller of one scenario, one sample at a time.
    %
    %   c = Fracgyro();               compiled beforehand, by build
    %   u = c.step(q, v)              every c.units.step seconds: the force [x; y] to hold until the next step
    %   c.estimates().rate_estimate   what it knows
    %
    % Everything is nondimensional: SI value = nondimensional value * c.units. A copy d = c is the same controller;
    % another Fracgyro() is another one.

    properties (SetAccess = private)
        units            % Struct: step in s, length in m, velocity in m/s, force in N, rate in rad/s, ...
        number           % 'double' or 'single': precision of its arithmetic
        velocity_sensed  % True if step needs the velocity
        gyroscope        % Struct: [q; v] after a step is A*[q; v] + B*u, from the initial [q; v] on; no noise
        statuses         % Cell array: possible values of the second output of step
    end

    properties (Access = private)
        mex
        handle
    end

    methods
        function self = Fracgyro()
            folder = fileparts(mfilename('fullpath'));
            if ~exist(fullfile(folder, ['fracgyro_mex.' mexext()]), 'file')
                error('fracgyro:unbuilt', 'fracgyro_mex is not compiled: run build in %s', folder);
            end
            name = class(self);  % 'gyro.Fracgyro' in a folder +gyro
            self.mex = str2func([name(1:end - length('Fracgyro')) 'fracgyro_mex']);
            facts = self.mex('facts');
            self.units = facts.units;
            self.number = facts.number;
            self.velocity_sensed = facts.velocity_sensed;
            self.gyroscope = struct('A', facts.gyroscope(:, 1:4), 'B', facts.gyroscope(:, 5:6), 'initial', facts.start);
            self.statuses = cellstr(facts.statuses);
            self.handle = self.mex('new');
        end

        function [force, status] = step(self, position, velocity)
            % [u, status] = c.step(q, v)  The force for the measured motion, [x y] each.
            %
            % For every input, u is finite and within the limit, and status is the guard's verdict: 'ok', 'saturated',
            % 'not_finite', ... Without a velocity sensor, c.step(q).
            if nargin < 3
                if self.velocity_sensed || nargin < 2
                    error('fracgyro:argument', 'an argument is missing: call step(position, velocity)');
                end
                velocity = [0 0];
            end
            if nargout < 2
                force = self.mex('step', self.handle, position, velocity);
            else
                [force, status] = self.mex('step', self.handle, position, velocity);
            end
        end

        function report = estimates(self)
            % e = c.estimates()  Struct of what the controller reports, before the coming step: vectors as [x; y],
            % symmetric matrices as [xx; xy; yy].
            report = self.mex('report', self.handle);
        end

        function reset(self)
            % c.reset()  To t = 0.
            self.mex('reset', self.handle);
        end

        function saved = save(self)
            % saved = c.save()  Everything that changes while running, as uint8.
            saved = self.mex('save', self.handle);
        end

        function restore(self, saved)
            % c.restore(saved)  Continues as the saved controller would have, bit for bit.
            self.mex('restore', self.handle, saved);
        end

        function delete(self)
            % delete(c)  Frees the controller.
            if ~isempty(self.handle)
                self.mex('delete', self.handle);
            end
        end
    end
end
